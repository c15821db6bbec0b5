/* geometry.c: reverse derivatives of the rows, gaps and slips of contacts. */
#include "grad/internal.h"

#include <math.h>

/* Of row(d) = (-cross(ra, d), -d, cross(rb, d), d): d_bar and the arms' cotangents. */
static carom_vec2 direction_row_vjp(const crm_contact *c, carom_vec2 d, const double g[6],
                                    carom_contact_bar *bar)
{
    const carom_vec2 ra = c->arm_a;
    const carom_vec2 rb = c->arm_b;
    const carom_vec2 d_bar = {ra.y * g[0] - g[1] - rb.y * g[3] + g[4],
                              -ra.x * g[0] - g[2] + rb.x * g[3] + g[5]};
    bar->arm_a.x -= d.y * g[0];
    bar->arm_a.y += d.x * g[0];
    bar->arm_b.x += d.y * g[3];
    bar->arm_b.y -= d.x * g[3];
    return d_bar;
}

void crm_contact_rows_vjp(const crm_contact *c, const double jn_bar[6], const double jt_bar[6],
                          carom_contact_bar *bar)
{
    const carom_vec2 n_bar = direction_row_vjp(c, c->normal, jn_bar, bar);
    bar->normal.x += n_bar.x;
    bar->normal.y += n_bar.y;
    if (!jt_bar) return;
    const carom_vec2 t = {-c->normal.y, c->normal.x};
    const carom_vec2 t_bar = direction_row_vjp(c, t, jt_bar, bar);
    bar->normal.x += t_bar.y;
    bar->normal.y -= t_bar.x;
}

static void add_pose(double *q_bar, int body, carom_pose p)
{
    q_bar[3 * body] += p.angle;
    q_bar[3 * body + 1] += p.x;
    q_bar[3 * body + 2] += p.y;
}

void crm_geometry_vjp(crm_reverse *r, const double *q, const crm_contact *c,
                      const carom_contact_bar *bar, double *q_bar)
{
    const carom_world *w = r->world;
    if (c->limit) {
        crm_limit_vjp(r, q, c->limit, bar, q_bar);
        return;
    }
    r->stats.contacts++;
    const crm_shape *a = &w->shapes[c->shape_a];
    const crm_shape *b = &w->shapes[c->shape_b];
    carom_vec2 *vertices = r->sink.g.vertices;
    carom_shape_bar a_bar = {{0, 0, 0}, 0, vertices ? vertices + a->first_vertex : NULL};
    carom_shape_bar b_bar = {{0, 0, 0}, 0, vertices ? vertices + b->first_vertex : NULL};
    carom_contact_vjp(&a->view, crm_pose(q, c->body_a), &b->view, crm_pose(q, c->body_b), c->recipe,
                      bar, &a_bar, &b_bar);
    add_pose(q_bar, c->body_a, a_bar.pose);
    add_pose(q_bar, c->body_b, b_bar.pose);
    if (r->sink.g.radius) {
        r->sink.g.radius[c->shape_a] += a_bar.radius;
        r->sink.g.radius[c->shape_b] += b_bar.radius;
    }
}

static void add_vertex(crm_reverse *r, int shape, int vertex, double x, double y)
{
    carom_vec2 *g = r->sink.g.vertices;
    if (!g) return;
    g += r->world->shapes[shape].first_vertex + vertex;
    g->x += x;
    g->y += y;
}

/* y = R_k' (x - p_k), x = p_i + R_i v, cotangent y_bar: to the poses, and *v_bar of the vertex. */
static void slide_point_vjp(const crm_slide *s, const double *q, carom_vec2 y_bar, double *q_bar,
                            carom_vec2 *v_bar)
{
    const double *k = q + 3 * s->face_body;
    const double ck = cos(k[0]);
    const double sk = sin(k[0]);
    const carom_vec2 y = crm_slide_point(s, q);
    const carom_vec2 x_bar = {ck * y_bar.x - sk * y_bar.y, sk * y_bar.x + ck * y_bar.y};
    q_bar[3 * s->face_body] += y.y * y_bar.x - y.x * y_bar.y;
    q_bar[3 * s->face_body + 1] -= x_bar.x;
    q_bar[3 * s->face_body + 2] -= x_bar.y;
    q_bar[3 * s->point_body + 1] += x_bar.x;
    q_bar[3 * s->point_body + 2] += x_bar.y;
    crm_arm_vjp(q[3 * s->point_body], s->v, x_bar, &q_bar[3 * s->point_body], v_bar);
}

/* slip = t . (y1 - y0) - r (turn of i - turn of k), t = (b - a) / |b - a|. */
static void slide_vjp(crm_reverse *r, const crm_contact *c, const double *q0, const double *q1,
                      double bar, double *q0_bar, double *q1_bar)
{
    const crm_slide s = crm_slide_of(r->world, c);
    const carom_vec2 up = {bar * s.t.x, bar * s.t.y};
    const carom_vec2 down = {-up.x, -up.y};
    carom_vec2 v_bar = {0, 0};
    slide_point_vjp(&s, q1, up, q1_bar, &v_bar);
    slide_point_vjp(&s, q0, down, q0_bar, &v_bar);
    q1_bar[3 * s.point_body] -= bar * s.radius;
    q0_bar[3 * s.point_body] += bar * s.radius;
    q1_bar[3 * s.face_body] += bar * s.radius;
    q0_bar[3 * s.face_body] -= bar * s.radius;
    const carom_vec2 y0 = crm_slide_point(&s, q0);
    const carom_vec2 y1 = crm_slide_point(&s, q1);
    const carom_vec2 d = {y1.x - y0.x, y1.y - y0.y};
    const double along = s.t.x * d.x + s.t.y * d.y;
    const double length = hypot(s.b.x - s.a.x, s.b.y - s.a.y);
    const carom_vec2 e_bar = {bar * (d.x - along * s.t.x) / length,
                              bar * (d.y - along * s.t.y) / length};
    const int n = r->world->shapes[s.face_shape].view.count;
    add_vertex(r, s.point_shape, c->recipe.inc, v_bar.x, v_bar.y);
    add_vertex(r, s.face_shape, (c->recipe.ref + 1) % n, e_bar.x, e_bar.y);
    add_vertex(r, s.face_shape, c->recipe.ref, -e_bar.x, -e_bar.y);
    if (r->sink.g.radius) {
        const double turn = (q1[3 * s.point_body] - q0[3 * s.point_body]) -
                            (q1[3 * s.face_body] - q0[3 * s.face_body]);
        r->sink.g.radius[s.point_shape] -= bar * turn;
    }
}

/* d angle(n) = cross(u, du) / |u|^2 for u from the center of A to that of B. */
static void angle_vjp(crm_reverse *r, const crm_contact *c, const double *q, double bar,
                      double *q_bar)
{
    const carom_world *w = r->world;
    const carom_vec2 va = w->shapes[c->shape_a].view.vertices[c->recipe.ref];
    const carom_vec2 vb = w->shapes[c->shape_b].view.vertices[c->recipe.inc];
    const carom_vec2 u = crm_centers(w, c, q);
    const double l2 = u.x * u.x + u.y * u.y;
    const carom_vec2 b_bar = {-bar * u.y / l2, bar * u.x / l2};
    const carom_vec2 a_bar = {-b_bar.x, -b_bar.y};
    carom_vec2 va_bar = {0, 0};
    carom_vec2 vb_bar = {0, 0};
    q_bar[3 * c->body_a + 1] += a_bar.x;
    q_bar[3 * c->body_a + 2] += a_bar.y;
    q_bar[3 * c->body_b + 1] += b_bar.x;
    q_bar[3 * c->body_b + 2] += b_bar.y;
    crm_arm_vjp(q[3 * c->body_a], va, a_bar, &q_bar[3 * c->body_a], &va_bar);
    crm_arm_vjp(q[3 * c->body_b], vb, b_bar, &q_bar[3 * c->body_b], &vb_bar);
    add_vertex(r, c->shape_a, c->recipe.ref, va_bar.x, va_bar.y);
    add_vertex(r, c->shape_b, c->recipe.inc, vb_bar.x, vb_bar.y);
}

/* slip = (ra + rb) angle(n0 -> n1) - ra turn of A - rb turn of B. */
static void roll_vjp(crm_reverse *r, const crm_contact *c, const double *q0, const double *q1,
                     double bar, double *q0_bar, double *q1_bar)
{
    const carom_world *w = r->world;
    const double ra = w->shapes[c->shape_a].view.radius;
    const double rb = w->shapes[c->shape_b].view.radius;
    angle_vjp(r, c, q1, bar * (ra + rb), q1_bar);
    angle_vjp(r, c, q0, -bar * (ra + rb), q0_bar);
    q1_bar[3 * c->body_a] -= bar * ra;
    q0_bar[3 * c->body_a] += bar * ra;
    q1_bar[3 * c->body_b] -= bar * rb;
    q0_bar[3 * c->body_b] += bar * rb;
    if (!r->sink.g.radius) return;
    const carom_vec2 u0 = crm_centers(w, c, q0);
    const carom_vec2 u1 = crm_centers(w, c, q1);
    const double angle = atan2(u0.x * u1.y - u0.y * u1.x, u0.x * u1.x + u0.y * u1.y);
    r->sink.g.radius[c->shape_a] += bar * (angle - (q1[3 * c->body_a] - q0[3 * c->body_a]));
    r->sink.g.radius[c->shape_b] += bar * (angle - (q1[3 * c->body_b] - q0[3 * c->body_b]));
}

void crm_slip_vjp(crm_reverse *r, const crm_contact *c, const double *q0, const double *q1,
                  double slip_bar, double *q0_bar, double *q1_bar)
{
    if (c->recipe.kernel == CAROM_POINT_POINT) {
        roll_vjp(r, c, q0, q1, slip_bar, q0_bar, q1_bar);
    } else {
        slide_vjp(r, c, q0, q1, slip_bar, q0_bar, q1_bar);
    }
}

static void put(double part[3], double turn, carom_vec2 along, double sign)
{
    part[0] = turn;
    part[1] = sign * along.x;
    part[2] = sign * along.y;
}

static void roll_row(const carom_world *w, const crm_contact *c, const double *q, double row[6])
{
    const crm_shape *a = &w->shapes[c->shape_a];
    const crm_shape *b = &w->shapes[c->shape_b];
    const carom_vec2 ra = crm_rotate(q[3 * c->body_a], a->view.vertices[c->recipe.ref]);
    const carom_vec2 rb = crm_rotate(q[3 * c->body_b], b->view.vertices[c->recipe.inc]);
    const carom_vec2 u = crm_centers(w, c, q);
    const double scale = (a->view.radius + b->view.radius) / (u.x * u.x + u.y * u.y);
    const carom_vec2 along = {-scale * u.y, scale * u.x};
    put(row, -(ra.x * along.y - ra.y * along.x) - a->view.radius, along, -1);
    put(row + 3, rb.x * along.y - rb.y * along.x - b->view.radius, along, 1);
}

static void slide_row(const carom_world *w, const crm_contact *c, const double *q, double row[6])
{
    const crm_slide s = crm_slide_of(w, c);
    const carom_vec2 along = crm_rotate(q[3 * s.face_body], s.t);
    const carom_vec2 arm = crm_rotate(q[3 * s.point_body], s.v);
    const carom_vec2 y = crm_slide_point(&s, q);
    double *point = row + (c->recipe.flipped ? 0 : 3);
    double *face = row + (c->recipe.flipped ? 3 : 0);
    put(point, arm.x * along.y - arm.y * along.x - s.radius, along, 1);
    put(face, s.t.x * y.y - s.t.y * y.x + s.radius, along, -1);
}

void crm_slip_row(const carom_world *w, const crm_contact *c, const double *q1, double row[6])
{
    if (c->recipe.kernel == CAROM_POINT_POINT) {
        roll_row(w, c, q1, row);
    } else {
        slide_row(w, c, q1, row);
    }
}

/* --- forward: the transposes of the above ------------------------------------------------------
 */

/* Of row(d) = (-cross(ra, d), -d, cross(rb, d), d). */
static void direction_row_jvp(const crm_contact *c, carom_vec2 d, const carom_contact_dot *dot,
                              carom_vec2 d_dot, double row[6])
{
    const carom_vec2 ra = c->arm_a;
    const carom_vec2 rb = c->arm_b;
    row[0] = -(dot->arm_a.x * d.y - dot->arm_a.y * d.x) - (ra.x * d_dot.y - ra.y * d_dot.x);
    row[1] = -d_dot.x;
    row[2] = -d_dot.y;
    row[3] = (dot->arm_b.x * d.y - dot->arm_b.y * d.x) + (rb.x * d_dot.y - rb.y * d_dot.x);
    row[4] = d_dot.x;
    row[5] = d_dot.y;
}

void crm_contact_rows_jvp(const crm_contact *c, const carom_contact_dot *dot, double jn[6],
                          double jt[6])
{
    const carom_vec2 t = {-c->normal.y, c->normal.x};
    const carom_vec2 t_dot = {-dot->normal.y, dot->normal.x};
    direction_row_jvp(c, c->normal, dot, dot->normal, jn);
    direction_row_jvp(c, t, dot, t_dot, jt);
}

static double radius_dot(const carom_gradient *by, int shape)
{
    return by->radius ? by->radius[shape] : 0;
}

/* Of the first vertex of a shape; NULL: they rest. */
static const carom_vec2 *vertices_dot(const carom_world *w, const carom_gradient *by, int shape)
{
    return by->vertices ? by->vertices + w->shapes[shape].first_vertex : NULL;
}

static carom_shape_dot shape_dot(const carom_world *w, int shape, int body, const double *q_dot,
                                 const carom_gradient *by)
{
    const carom_shape_dot dot = {crm_pose(q_dot, body), radius_dot(by, shape),
                                 vertices_dot(w, by, shape)};
    return dot;
}

carom_contact_dot crm_geometry_jvp(const carom_world *w, const double *q, const crm_contact *c,
                                   const double *q_dot, const carom_gradient *by)
{
    if (c->limit) return crm_limit_jvp(w, q, c->limit, q_dot, by);
    const carom_shape_dot a = shape_dot(w, c->shape_a, c->body_a, q_dot, by);
    const carom_shape_dot b = shape_dot(w, c->shape_b, c->body_b, q_dot, by);
    return carom_contact_jvp(&w->shapes[c->shape_a].view, crm_pose(q, c->body_a),
                             &w->shapes[c->shape_b].view, crm_pose(q, c->body_b), c->recipe, &a,
                             &b);
}

/* Of a vertex in the world, x = p + R v. */
static carom_vec2 vertex_jvp(const double *q, const double *q_dot, int body, carom_vec2 v,
                             const carom_vec2 *v_dot)
{
    carom_vec2 x = crm_arm_jvp(q[3 * body], v, q_dot[3 * body], v_dot);
    x.x += q_dot[3 * body + 1];
    x.y += q_dot[3 * body + 2];
    return x;
}

/* y = R_k' (x - p_k):  y_dot = R_k' (x_dot - p_k_dot) - angle_dot left(y). */
static carom_vec2 slide_point_jvp(const crm_slide *s, const double *q, const double *q_dot,
                                  const carom_vec2 *v_dot)
{
    const int k = 3 * s->face_body;
    const carom_vec2 y = crm_slide_point(s, q);
    carom_vec2 d = vertex_jvp(q, q_dot, s->point_body, s->v, v_dot);
    d.x -= q_dot[k + 1];
    d.y -= q_dot[k + 2];
    d = crm_rotate(-q[k], d);
    d.x += q_dot[k] * y.y;
    d.y -= q_dot[k] * y.x;
    return d;
}

/* What the turns from q0 to q1 of two bodies differ in. */
static double turn_between(const double *q0, const double *q1, int of, int against)
{
    return (q1[3 * of] - q0[3 * of]) - (q1[3 * against] - q0[3 * against]);
}

/* t . (y1 - y0) of a face that changes its direction, t = (b - a) / |b - a|. */
static double face_jvp(const crm_slide *s, const double *q0, const double *q1, carom_vec2 a_dot,
                       carom_vec2 b_dot)
{
    const carom_vec2 y0 = crm_slide_point(s, q0);
    const carom_vec2 y1 = crm_slide_point(s, q1);
    const carom_vec2 e_dot = {b_dot.x - a_dot.x, b_dot.y - a_dot.y};
    const carom_vec2 d = {y1.x - y0.x, y1.y - y0.y};
    const double across = s->t.x * d.y - s->t.y * d.x;
    return across * (s->t.x * e_dot.y - s->t.y * e_dot.x) / hypot(s->b.x - s->a.x, s->b.y - s->a.y);
}

static double slide_jvp(const carom_world *w, const crm_contact *c, const double *q0,
                        const double *q1, const double *q0_dot, const double *q1_dot,
                        const carom_gradient *by)
{
    const crm_slide s = crm_slide_of(w, c);
    const carom_vec2 *point = vertices_dot(w, by, s.point_shape);
    const carom_vec2 *face = vertices_dot(w, by, s.face_shape);
    const carom_vec2 *v_dot = point ? &point[c->recipe.inc] : NULL;
    const carom_vec2 y0 = slide_point_jvp(&s, q0, q0_dot, v_dot);
    const carom_vec2 y1 = slide_point_jvp(&s, q1, q1_dot, v_dot);
    double slip = s.t.x * (y1.x - y0.x) + s.t.y * (y1.y - y0.y);
    slip -= s.radius * turn_between(q0_dot, q1_dot, s.point_body, s.face_body);
    slip -= radius_dot(by, s.point_shape) * turn_between(q0, q1, s.point_body, s.face_body);
    if (!face) return slip;
    const int n = w->shapes[s.face_shape].view.count;
    return slip + face_jvp(&s, q0, q1, face[c->recipe.ref], face[(c->recipe.ref + 1) % n]);
}

static double angle_jvp(const carom_world *w, const crm_contact *c, const double *q,
                        const double *q_dot, const carom_gradient *by)
{
    const carom_vec2 va = w->shapes[c->shape_a].view.vertices[c->recipe.ref];
    const carom_vec2 vb = w->shapes[c->shape_b].view.vertices[c->recipe.inc];
    const carom_vec2 *va_dot = vertices_dot(w, by, c->shape_a);
    const carom_vec2 *vb_dot = vertices_dot(w, by, c->shape_b);
    const carom_vec2 u = crm_centers(w, c, q);
    const carom_vec2 a =
        vertex_jvp(q, q_dot, c->body_a, va, va_dot ? &va_dot[c->recipe.ref] : NULL);
    const carom_vec2 b =
        vertex_jvp(q, q_dot, c->body_b, vb, vb_dot ? &vb_dot[c->recipe.inc] : NULL);
    return (u.x * (b.y - a.y) - u.y * (b.x - a.x)) / (u.x * u.x + u.y * u.y);
}

static double roll_jvp(const carom_world *w, const crm_contact *c, const double *q0,
                       const double *q1, const double *q0_dot, const double *q1_dot,
                       const carom_gradient *by)
{
    const double ra = w->shapes[c->shape_a].view.radius;
    const double rb = w->shapes[c->shape_b].view.radius;
    const int a = 3 * c->body_a;
    const int b = 3 * c->body_b;
    double slip = (ra + rb) * (angle_jvp(w, c, q1, q1_dot, by) - angle_jvp(w, c, q0, q0_dot, by));
    slip -= ra * (q1_dot[a] - q0_dot[a]) + rb * (q1_dot[b] - q0_dot[b]);
    if (!by->radius) return slip;
    const carom_vec2 u0 = crm_centers(w, c, q0);
    const carom_vec2 u1 = crm_centers(w, c, q1);
    const double angle = atan2(u0.x * u1.y - u0.y * u1.x, u0.x * u1.x + u0.y * u1.y);
    slip += by->radius[c->shape_a] * (angle - (q1[a] - q0[a]));
    return slip + by->radius[c->shape_b] * (angle - (q1[b] - q0[b]));
}

double crm_slip_jvp(const carom_world *w, const crm_contact *c, const double *q0, const double *q1,
                    const double *q0_dot, const double *q1_dot, const carom_gradient *by)
{
    return c->recipe.kernel == CAROM_POINT_POINT ? roll_jvp(w, c, q0, q1, q0_dot, q1_dot, by)
                                                 : slide_jvp(w, c, q0, q1, q0_dot, q1_dot, by);
}
