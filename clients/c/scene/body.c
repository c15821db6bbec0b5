#include "body.h"

#include "mass.h"

#include <stdlib.h>
#include <string.h>

static const char *const type_words[] = {"dynamic", "static", "kinematic", NULL};

static const char *const body_keys[] = {"name",        "type",    "shape",    "shapes",
                                        "position",    "angle",   "velocity", "angular_velocity",
                                        "mass",        "inertia", "density",  "friction",
                                        "restitution", "collide", "filter",   "forces",
                                        NULL};

static void read_motion(crm_problems *problems, const crm_node *node, carom_body_def *def)
{
    const crm_node position = crm_member(node, "position");
    const crm_node angle = crm_member(node, "angle");
    const crm_node velocity = crm_member(node, "velocity");
    const crm_node spin = crm_member(node, "angular_velocity");
    double xy[2] = {0, 0};
    crm_get_numbers(problems, &position, 2, xy);
    crm_get_number(problems, &angle, &def->pose.angle);
    crm_get_numbers(problems, &velocity, 2, &def->velocity[1]);
    crm_get_number(problems, &spin, &def->velocity[0]);
    def->pose.x = xy[0];
    def->pose.y = xy[1];
    const double *v = def->velocity;
    if (def->type == CAROM_STATIC && (v[0] != 0 || v[1] != 0 || v[2] != 0)) {
        crm_fault(problems, v[0] != 0 ? &spin : &velocity,
                  "a static body does not move; use 0, or the type kinematic");
    }
}

static void read_material(crm_problems *problems, const crm_node *node, carom_body_def *def)
{
    const crm_node friction = crm_member(node, "friction");
    const crm_node restitution = crm_member(node, "restitution");
    const crm_node collide = crm_member(node, "collide");
    if (crm_get_number(problems, &friction, &def->friction) && def->friction < 0) {
        crm_fault(problems, &friction, "must be >= 0, is %.17g", def->friction);
    }
    if (crm_get_number(problems, &restitution, &def->restitution) &&
        !(def->restitution >= 0 && def->restitution <= 1)) {
        crm_fault(problems, &restitution, "must be from 0 to 1, is %.17g", def->restitution);
    }
    crm_get_flag(problems, &collide, &def->collide);
}

static void read_filter(crm_problems *problems, const crm_node *node, carom_filter *filter)
{
    static const char *const keys[] = {"category", "mask", "group", NULL};
    const crm_node at = crm_member(node, "filter");
    if (!at.json || !crm_check_keys(problems, &at, keys)) return;
    const crm_node category = crm_member(&at, "category");
    const crm_node mask = crm_member(&at, "mask");
    const crm_node group = crm_member(&at, "group");
    json_int_t x = 0;
    if (crm_get_integer(problems, &category, 0, 4294967295.0, &x)) filter->category = (unsigned)x;
    if (crm_get_integer(problems, &mask, 0, 4294967295.0, &x)) filter->mask = (unsigned)x;
    if (crm_get_integer(problems, &group, -2147483647.0, 2147483647.0, &x)) filter->group = (int)x;
}

/* One positive number in the unit; 1 when it was given. */
static int read_positive(crm_problems *problems, const crm_node *node, const char *unit, double *x)
{
    if (!crm_get_number(problems, node, x)) return node->json != NULL;
    if (!(*x > 0)) crm_fault(problems, node, "must be > 0 [%s], is %.17g", unit, *x);
    return 1;
}

/* Mass and inertia, or density; static and kinematic bodies need neither. */
static void read_mass(crm_problems *problems, const crm_node *node, crm_scene_body *body)
{
    const crm_node mass = crm_member(node, "mass");
    const crm_node inertia = crm_member(node, "inertia");
    const crm_node density = crm_member(node, "density");
    body->has_mass = read_positive(problems, &mass, "kg", &body->def.mass);
    body->has_inertia = read_positive(problems, &inertia, "kg m^2", &body->def.inertia);
    body->has_density = read_positive(problems, &density, "kg/m^2", &body->density);
    if (body->has_density && (body->has_mass || body->has_inertia)) {
        crm_fault(problems, &density, "mass and inertia follow from it; give either it or them");
    }
    if (body->def.type == CAROM_DYNAMIC && !body->has_mass && !body->has_density) {
        crm_fault(problems, &mass, "a dynamic body needs a mass [kg], or a density [kg/m^2]");
    }
}

static void read_shapes(crm_problems *problems, const crm_node *node, carom_body_def *def)
{
    const crm_node one = crm_member(node, "shape");
    const crm_node many = crm_member(node, "shapes");
    if (one.json && many.json) crm_fault(problems, &many, "stands beside shape; keep one of them");
    if (many.json && !json_is_array(many.json)) {
        crm_fault(problems, &many, "must be an array of shapes");
    }
    const int n = one.json ? 1 : crm_length(&many);
    if (n == 0) return;
    carom_shape *shapes = crm_make(problems, (size_t)n, sizeof *shapes);
    if (!shapes) return;
    def->shapes = shapes;
    def->n_shapes = n;
    for (int k = 0; k < n; k++) {
        const crm_node item = crm_item(&many, k);
        crm_shape_read(problems, one.json ? &one : &item, &shapes[k]);
    }
}

static void read_row(crm_problems *problems, const crm_node *node, crm_scene_body *body, int i)
{
    double row[4] = {0, 0, 0, 0};
    if (!crm_get_numbers(problems, node, 4, row)) return;
    body->rows[i].time = row[0];
    memcpy(body->rows[i].force, row + 1, 3 * sizeof(double));
    if (i > 0 && !(row[0] > body->rows[i - 1].time)) {
        const crm_node time = crm_item(node, 0);
        crm_fault(problems, &time, "times must increase, %.17g follows %.17g", row[0],
                  body->rows[i - 1].time);
    }
}

/* [torque, fx, fy], or rows [t, torque, fx, fy]. */
static void read_forces(crm_problems *problems, const crm_node *node, crm_scene_body *body)
{
    const crm_node at = crm_member(node, "forces");
    if (!at.json) return;
    const int n = crm_length(&at);
    const crm_node first = crm_item(&at, 0);
    if (!json_is_array(at.json) || (n == 0 || (!json_is_array(first.json) && n != 3))) {
        crm_fault(problems, &at, "must be [torque, fx, fy] or rows [t, torque, fx, fy]");
        return;
    }
    if (!json_is_array(first.json)) {
        crm_get_numbers(problems, &at, 3, body->def.force);
        return;
    }
    body->rows = crm_make(problems, (size_t)n, sizeof *body->rows);
    if (!body->rows) return;
    body->n_rows = n;
    for (int i = 0; i < n; i++) {
        const crm_node item = crm_item(&at, i);
        read_row(problems, &item, body, i);
    }
}

void crm_body_read(crm_problems *problems, const crm_node *node, crm_scene_body *body)
{
    body->def = carom_body_defaults();
    if (!crm_check_keys(problems, node, body_keys)) return;
    const int before = problems->count;
    const crm_node name = crm_member(node, "name");
    const crm_node type = crm_member(node, "type");
    crm_get_text(problems, &name, &body->name);
    if (type.json) {
        const int word = crm_get_word(problems, &type, type_words);
        /* a kinematic body asks for nothing more: one fault is enough */
        body->def.type = word >= 0 ? (carom_body_type)word : CAROM_KINEMATIC;
    }
    read_motion(problems, node, &body->def);
    read_material(problems, node, &body->def);
    read_filter(problems, node, &body->def.filter);
    read_mass(problems, node, body);
    read_shapes(problems, node, &body->def);
    read_forces(problems, node, body);
    if (problems->count == before && !problems->no_memory) crm_body_mass(problems, node, body);
}

void crm_body_free(crm_scene_body *body)
{
    carom_shape *shapes = (carom_shape *)body->def.shapes; /* the reader's own copy */
    for (int k = 0; k < body->def.n_shapes; k++) crm_shape_free(&shapes[k]);
    free(shapes);
    free(body->rows);
}
