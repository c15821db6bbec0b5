/* copy.c: another world like one that there is. */
#include "carom/snapshot.h"
#include "world/internal.h"

static void copy(void *to, const void *from, int n, size_t size)
{
    if (to && from) memcpy(to, from, (size_t)n * size);
}

static carom_status copy_bodies(carom_world *w, const carom_world *from)
{
    const int n = from->n_bodies;
    while (w->n_bodies < n) {
        const carom_status e = crm_reserve_bodies(w);
        if (e) return e;
        w->n_bodies = w->max_bodies < n ? w->max_bodies : n;
    }
    copy(w->bodies, from->bodies, n, sizeof *w->bodies);
    copy(w->q, from->q, 3 * n, sizeof *w->q);
    copy(w->v, from->v, 3 * n, sizeof *w->v);
    copy(w->force, from->force, 3 * n, sizeof *w->force);
    copy(w->mass, from->mass, n, sizeof *w->mass);
    copy(w->inertia, from->inertia, n, sizeof *w->inertia);
    copy(w->friction, from->friction, n, sizeof *w->friction);
    copy(w->restitution, from->restitution, n, sizeof *w->restitution);
    return CAROM_OK;
}

static carom_status copy_list(carom_world *w, void **to, int *max, const void *from, int n,
                              size_t size)
{
    const carom_status e = crm_reserve(&w->memory, to, max, n, size);
    if (!e) copy(*to, from, n, size);
    return e;
}

static carom_status copy_shapes(carom_world *w, const carom_world *from)
{
    void *shapes = NULL;
    void *vertices = NULL;
    carom_status e =
        copy_list(w, &shapes, &w->max_shapes, from->shapes, from->n_shapes, sizeof *w->shapes);
    w->shapes = shapes;
    if (e) return e;
    e = copy_list(w, &vertices, &w->max_vertices, from->vertices, from->n_vertices,
                  sizeof *w->vertices);
    w->vertices = vertices;
    if (e) return e;
    w->n_shapes = from->n_shapes;
    w->n_vertices = from->n_vertices;
    for (int k = 0; w->shapes && k < w->n_shapes; k++) {
        w->shapes[k].view.vertices = w->vertices + w->shapes[k].first_vertex;
    }
    return CAROM_OK;
}

static carom_status copy_joints(carom_world *w, const carom_world *from)
{
    void *joints = NULL;
    void *excluded = NULL;
    carom_status e =
        copy_list(w, &joints, &w->max_joints, from->joints, from->n_joints, sizeof *w->joints);
    w->joints = joints;
    if (e) return e;
    e = copy_list(w, &excluded, &w->max_excluded, from->excluded, from->n_excluded,
                  sizeof *w->excluded);
    w->excluded = excluded;
    if (e) return e;
    void *fields = NULL;
    e = copy_list(w, &fields, &w->max_fields, from->fields, from->n_fields, sizeof *w->fields);
    w->fields = fields;
    if (e) return e;
    w->n_fields = from->n_fields;
    w->n_joints = from->n_joints;
    w->n_joint_rows = from->n_joint_rows;
    w->n_breakable = from->n_breakable;
    w->n_excluded = from->n_excluded;
    return CAROM_OK;
}

/* What a world has since it was sealed. */
static carom_status copy_progress(carom_world *w, const carom_world *from)
{
    carom_status e = crm_seal_as_is(w);
    crm_touches *lists[2] = {&w->touches, &w->next};
    for (int i = 0; !e && i < 2; i++) { /* both, for they take turns */
        void *list = NULL;
        e = copy_list(w, &list, &lists[i]->max, from->touches.list, from->touches.n,
                      sizeof *from->touches.list);
        lists[i]->list = list;
    }
    if (e) return e;
    w->touches.n = from->touches.n;
    w->length = from->length;
    w->speed = from->speed;
    w->rest_speed = from->rest_speed;
    w->recovery = from->recovery;
    copy(w->carry, from->carry, w->n_bodies, sizeof *w->carry);
    copy(w->owes, from->owes, w->n_bodies, 1);
    for (int i = 0; i < 2; i++) {
        copy(w->joint_force[i], from->joint_force[i], w->n_joint_rows, sizeof(double));
    }
    copy(w->joint_total, from->joint_total, w->n_joint_rows, sizeof(double));
    w->n_steps = from->n_steps;
    return CAROM_OK;
}

carom_status carom_world_copy(const carom_world *world, const carom_allocator *allocator,
                              carom_world **out)
{
    if (!out) return CAROM_E_ARGUMENT;
    *out = NULL;
    if (!world) return CAROM_E_ARGUMENT;
    carom_world *w = NULL;
    carom_status e = carom_world_create(&world->settings, allocator, &w);
    if (e) return e;
    e = copy_bodies(w, world);
    if (!e) e = copy_shapes(w, world);
    if (!e) e = copy_joints(w, world);
    if (!e && world->sealed) e = copy_progress(w, world);
    if (e) {
        carom_world_destroy(w);
        return e;
    }
    *out = w;
    return CAROM_OK;
}
