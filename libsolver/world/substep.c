/* substep.c: memory of one sub-step and of the rows of its contact problems. */
#include "world/block.h"
#include "world/internal.h"

typedef void (*layout)(const carom_world *w, int n, crm_block *b, void *object);

/* Makes the block that `lay` describes for n contacts: measured first, then carved.  The object is
 * changed only when the memory is there. */
static carom_status make_block(carom_world *w, int n, layout lay, void *object, void **block,
                               size_t *bytes)
{
    crm_block b = {NULL, 0};
    lay(w, n, &b, NULL);
    char *base = crm_new(&w->memory, b.used, 1);
    if (!base) return CAROM_E_MEMORY;
    crm_block c = {base, 0};
    lay(w, n, &c, object);
    *block = base;
    *bytes = b.used;
    return CAROM_OK;
}

static void lay_states(const carom_world *w, int n, crm_block *b, void *object)
{
    (void)n;
    crm_substep none = {0};
    crm_substep *s = object ? object : &none;
    const size_t n3 = 3 * (size_t)w->n_bodies;
    const size_t rows = (size_t)w->n_joint_rows;
    s->q0 = crm_carve(b, n3, sizeof(double));
    s->v0 = crm_carve(b, n3, sizeof(double));
    s->q1 = crm_carve(b, n3, sizeof(double));
    s->v1 = crm_carve(b, n3, sizeof(double));
    s->joint_target = crm_carve(b, rows, sizeof(double));
    for (int k = 0; k < w->n_solves; k++) {
        crm_solve *c = &s->solve[k];
        c->q = crm_carve(b, n3, sizeof(double));
        c->v = crm_carve(b, n3, sizeof(double));
        c->ce = crm_carve(b, rows, sizeof(double));
        c->le = crm_carve(b, rows, sizeof(double));
        c->motor = crm_carve(b, rows, 1);
    }
}

static void lay_contacts(const carom_world *w, int n, crm_block *b, void *object)
{
    (void)w;
    crm_substep none = {0};
    crm_substep *s = object ? object : &none;
    const size_t m = (size_t)n;
    s->contacts = crm_carve(b, m, sizeof *s->contacts);
    s->moved = crm_carve(b, m, sizeof *s->moved);
    s->pressing = crm_carve(b, m, 1);
    s->slips = crm_carve(b, m, 1);
    s->target = crm_carve(b, m, sizeof(double));
    for (int k = 0; k < CRM_MAX_SOLVES; k++) {
        crm_solve *c = &s->solve[k];
        c->cn = crm_carve(b, m, sizeof(double));
        c->ct = crm_carve(b, m, sizeof(double));
        c->ln = crm_carve(b, m, sizeof(double));
        c->lt = crm_carve(b, m, sizeof(double));
        c->mode = crm_carve(b, m, 1);
    }
}

carom_status crm_substep_create(carom_world *w, crm_substep *s)
{
    return make_block(w, 0, lay_states, s, &s->state_block, &s->state_bytes);
}

carom_status crm_substeps_create(carom_world *w)
{
    const int columns = w->plan.extrapolated ? w->settings.order / 2 : 1;
    carom_status e = crm_substep_create(w, &w->sub);
    for (int k = 0; !e && columns > 1 && k < columns * (columns + 1) / 2; k++) {
        e = crm_substep_create(w, &w->inner[k]);
    }
    return e;
}

carom_status crm_substep_reserve(carom_world *w, crm_substep *s, int n_contacts)
{
    if (n_contacts <= s->max_contacts) return CAROM_OK;
    const int n = n_contacts + n_contacts / 2 + 8;
    const crm_contact *old = s->contacts;
    void *old_block = s->contact_block;
    const size_t old_bytes = s->contact_bytes;
    const carom_status e = make_block(w, n, lay_contacts, s, &s->contact_block, &s->contact_bytes);
    if (e) return e;
    if (old) memcpy(s->contacts, old, (size_t)s->n_contacts * sizeof *old);
    crm_free(&w->memory, old_block, old_bytes, 1);
    s->max_contacts = n;
    return CAROM_OK;
}

void crm_substep_free(carom_world *w, crm_substep *s)
{
    crm_free(&w->memory, s->state_block, s->state_bytes, 1);
    crm_free(&w->memory, s->contact_block, s->contact_bytes, 1);
    memset(s, 0, sizeof *s);
}

static void lay_fixed_rows(const carom_world *w, int n, crm_block *b, void *object)
{
    (void)n;
    crm_rows none = {0};
    crm_rows *r = object ? object : &none;
    const size_t rows = (size_t)w->n_joint_rows;
    const size_t n3 = 3 * (size_t)w->n_moving;
    r->joint_body = crm_carve(b, 2 * rows, sizeof(int));
    r->je = crm_carve(b, 6 * rows, sizeof(double));
    r->left = crm_carve(b, 6 * rows, sizeof(double));
    r->error = crm_carve(b, rows, sizeof(double));
    r->ye = crm_carve(b, rows, sizeof(double));
    r->u = crm_carve(b, n3, sizeof(double));
    r->v = crm_carve(b, n3, sizeof(double));
    r->inv_mass = crm_carve(b, n3, sizeof(double));
}

static void lay_contact_rows(const carom_world *w, int n, crm_block *b, void *object)
{
    (void)w;
    crm_rows none = {0};
    crm_rows *r = object ? object : &none;
    const size_t m = (size_t)n;
    r->contact_body = crm_carve(b, 2 * m, sizeof(int));
    r->jn = crm_carve(b, 6 * m, sizeof(double));
    r->jt = crm_carve(b, 6 * m, sizeof(double));
    r->mu = crm_carve(b, m, sizeof(double));
    r->zero = crm_carve(b, m, sizeof(double));
    r->yn = crm_carve(b, m, sizeof(double));
}

carom_status crm_rows_create(carom_world *w)
{
    crm_rows *r = &w->rows;
    return make_block(w, 0, lay_fixed_rows, r, &r->fixed_block, &r->fixed_bytes);
}

carom_status crm_rows_reserve(carom_world *w, int n_contacts)
{
    crm_rows *r = &w->rows;
    if (n_contacts <= r->max_contacts) return CAROM_OK;
    const int n = n_contacts + n_contacts / 2 + 8;
    void *old = r->contact_block;
    const size_t old_bytes = r->contact_bytes;
    const carom_status e =
        make_block(w, n, lay_contact_rows, r, &r->contact_block, &r->contact_bytes);
    if (e) return e;
    crm_free(&w->memory, old, old_bytes, 1);
    r->max_contacts = n;
    return CAROM_OK;
}

void crm_rows_free(carom_world *w)
{
    crm_free(&w->memory, w->rows.fixed_block, w->rows.fixed_bytes, 1);
    crm_free(&w->memory, w->rows.contact_block, w->rows.contact_bytes, 1);
    memset(&w->rows, 0, sizeof w->rows);
}
