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
                      const carom_contact_bar *bar, double *q_bar, int with_parameters)
{
    const carom_world *w = r->world;
    if (c->limit) {
        crm_limit_vjp(r, q, c->limit, bar, q_bar, with_parameters);
        return;
    }
    const crm_shape *a = &w->shapes[c->shape_a];
    const crm_shape *b = &w->shapes[c->shape_b];
    carom_vec2 *vertices = with_parameters ? r->sink.g.vertices : NULL;
    carom_shape_bar a_bar = {{0, 0, 0}, 0, vertices ? vertices + a->first_vertex : NULL};
    carom_shape_bar b_bar = {{0, 0, 0}, 0, vertices ? vertices + b->first_vertex : NULL};
    carom_contact_vjp(&a->view, crm_pose(q, c->body_a), &b->view, crm_pose(q, c->body_b), c->recipe,
                      bar, &a_bar, &b_bar);
    add_pose(q_bar, c->body_a, a_bar.pose);
    add_pose(q_bar, c->body_b, b_bar.pose);
    if (with_parameters && r->sink.g.radius) {
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
                      double bar, double *q0_bar, double *q1_bar, int with_parameters)
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
    if (!with_parameters) return;
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
                      double *q_bar, int with_parameters)
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
    if (!with_parameters) return;
    add_vertex(r, c->shape_a, c->recipe.ref, va_bar.x, va_bar.y);
    add_vertex(r, c->shape_b, c->recipe.inc, vb_bar.x, vb_bar.y);
}

/* slip = (ra + rb) angle(n0 -> n1) - ra turn of A - rb turn of B. */
static void roll_vjp(crm_reverse *r, const crm_contact *c, const double *q0, const double *q1,
                     double bar, double *q0_bar, double *q1_bar, int with_parameters)
{
    const carom_world *w = r->world;
    const double ra = w->shapes[c->shape_a].view.radius;
    const double rb = w->shapes[c->shape_b].view.radius;
    angle_vjp(r, c, q1, bar * (ra + rb), q1_bar, with_parameters);
    angle_vjp(r, c, q0, -bar * (ra + rb), q0_bar, with_parameters);
    q1_bar[3 * c->body_a] -= bar * ra;
    q0_bar[3 * c->body_a] += bar * ra;
    q1_bar[3 * c->body_b] -= bar * rb;
    q0_bar[3 * c->body_b] += bar * rb;
    if (!with_parameters || !r->sink.g.radius) return;
    const carom_vec2 u0 = crm_centers(w, c, q0);
    const carom_vec2 u1 = crm_centers(w, c, q1);
    const double angle = atan2(u0.x * u1.y - u0.y * u1.x, u0.x * u1.x + u0.y * u1.y);
    r->sink.g.radius[c->shape_a] += bar * (angle - (q1[3 * c->body_a] - q0[3 * c->body_a]));
    r->sink.g.radius[c->shape_b] += bar * (angle - (q1[3 * c->body_b] - q0[3 * c->body_b]));
}

void crm_slip_vjp(crm_reverse *r, const crm_contact *c, const double *q0, const double *q1,
                  double slip_bar, double *q0_bar, double *q1_bar, int with_parameters)
{
    if (c->recipe.kernel == CAROM_POINT_POINT) {
        roll_vjp(r, c, q0, q1, slip_bar, q0_bar, q1_bar, with_parameters);
    } else {
        slide_vjp(r, c, q0, q1, slip_bar, q0_bar, q1_bar, with_parameters);
    }
}
