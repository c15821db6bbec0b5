#include "contact_case.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void layout(contact_case *c, int nb, int nc, int ne, double *d, int *i, unsigned char *m)
{
    c->inv_mass = d;
    c->u = c->inv_mass + 3 * nb;
    c->jn = c->u + 3 * nb;
    c->jt = c->jn + 6 * nc;
    c->mu = c->jt + 6 * nc;
    c->cn = c->mu + nc;
    c->ct = c->cn + nc;
    c->je = c->ct + nc;
    c->ce = c->je + 6 * ne;
    c->x.v = c->ce + ne;
    c->x.ln = c->x.v + 3 * nb;
    c->x.lt = c->x.ln + nc;
    c->x.le = c->x.lt + nc;
    c->contact_body = i;
    c->joint_body = i + 2 * nc;
    c->x.mode = m;
    c->p.inv_mass = c->inv_mass;
    c->p.u = c->u;
    c->p.contact_body = c->contact_body;
    c->p.jn = c->jn;
    c->p.jt = c->jt;
    c->p.mu = c->mu;
    c->p.cn = c->cn;
    c->p.ct = c->ct;
    c->p.joint_body = c->joint_body;
    c->p.je = c->je;
    c->p.ce = c->ce;
}

contact_case contact_case_new(int n_bodies, int max_contacts, int max_rows)
{
    contact_case c;
    memset(&c, 0, sizeof c);
    const size_t nb = (size_t)n_bodies;
    const size_t nc = (size_t)max_contacts;
    const size_t ne = (size_t)max_rows;
    const size_t nd = 9 * nb + 17 * nc + 8 * ne;
    const size_t ni = 2 * nc + 2 * ne;
    c.block = calloc(1, nd * sizeof(double) + ni * sizeof(int) + nc + 1);
    if (!c.block) {
        fprintf(stderr, "contact_case: out of memory\n");
        exit(1);
    }
    double *d = c.block;
    int *i = (int *)(void *)(d + nd);
    layout(&c, n_bodies, max_contacts, max_rows, d, i, (unsigned char *)(i + ni));
    c.p.n_bodies = n_bodies;
    c.max_contacts = max_contacts;
    c.max_rows = max_rows;
    return c;
}

void contact_case_free(contact_case *c)
{
    free(c->block);
    memset(c, 0, sizeof *c);
}

contact_case contact_case_copy(const contact_case *c)
{
    contact_case d = contact_case_new(c->p.n_bodies, c->max_contacts, c->max_rows);
    const size_t nb = (size_t)c->p.n_bodies;
    const size_t nc = (size_t)c->max_contacts;
    const size_t ne = (size_t)c->max_rows;
    memcpy(d.block, c->block,
           (9 * nb + 17 * nc + 8 * ne) * sizeof(double) + (2 * nc + 2 * ne) * sizeof(int) + nc);
    d.p.n_contacts = c->p.n_contacts;
    d.p.n_joint_rows = c->p.n_joint_rows;
    return d;
}

void contact_case_body(contact_case *c, int body, double mass, double inertia, double omega,
                       double vx, double vy)
{
    double *w = c->inv_mass + 3 * body;
    double *u = c->u + 3 * body;
    w[0] = 1 / inertia;
    w[1] = w[2] = 1 / mass;
    u[0] = omega;
    u[1] = vx;
    u[2] = vy;
}

int contact_case_contact(contact_case *c, int a, int b, const double *ra, const double *rb,
                         const double *n, double mu, double cn)
{
    const int k = c->p.n_contacts++;
    const double t[2] = {-n[1], n[0]};
    double *jn = c->jn + 6 * k;
    double *jt = c->jt + 6 * k;
    c->contact_body[2 * k] = a;
    c->contact_body[2 * k + 1] = b;
    jn[0] = -(ra[0] * n[1] - ra[1] * n[0]);
    jn[3] = rb[0] * n[1] - rb[1] * n[0];
    jt[0] = -(ra[0] * t[1] - ra[1] * t[0]);
    jt[3] = rb[0] * t[1] - rb[1] * t[0];
    for (int i = 0; i < 2; i++) {
        jn[1 + i] = -n[i];
        jn[4 + i] = n[i];
        jt[1 + i] = -t[i];
        jt[4 + i] = t[i];
    }
    c->mu[k] = mu;
    c->cn[k] = cn;
    c->ct[k] = 0;
    return k;
}

int contact_case_hinge(contact_case *c, int a, int b, const double *ra, const double *rb)
{
    const int r = c->p.n_joint_rows;
    const double rows[12] = {-ra[1], 1, 0, rb[1], -1, 0, ra[0], 0, 1, -rb[0], 0, -1};
    memcpy(c->je + 6 * r, rows, sizeof rows);
    for (int i = 0; i < 2; i++) {
        c->joint_body[2 * (r + i)] = a;
        c->joint_body[2 * (r + i) + 1] = b;
        c->ce[r + i] = 0;
    }
    c->p.n_joint_rows += 2;
    return r;
}

/* Adds the entries of t to two-body rows; -1 when a third body appears. */
static int add_entries(const problem_triplets *t, int *body, double *rows)
{
    for (int k = 0; k < t->n; k++) {
        int *pair = body + 2 * t->i[k];
        const int b = t->j[k] / 3;
        if (t->x[k] == 0) continue;
        const int e = pair[0] == b || pair[0] < 0 ? 0 : 1;
        if (pair[e] >= 0 && pair[e] != b) return -1;
        pair[e] = b;
        rows[6 * t->i[k] + 3 * e + t->j[k] % 3] += t->x[k];
    }
    return 0;
}

int contact_case_from_file(const problem_file *f, contact_case *c)
{
    *c = contact_case_new(f->n_bodies, f->n_contacts, f->n_joint_rows);
    c->p.n_contacts = f->n_contacts;
    c->p.n_joint_rows = f->n_joint_rows;
    for (int i = 0; i < 3 * f->n_bodies; i++) {
        c->inv_mass[i] = 1 / f->M[i];
        c->u[i] = -f->q[i] / f->M[i];
    }
    for (int k = 0; k < 2 * f->n_contacts; k++) c->contact_body[k] = -1;
    for (int r = 0; r < 2 * f->n_joint_rows; r++) c->joint_body[r] = -1;
    for (int k = 0; k < f->n_contacts; k++) {
        c->mu[k] = f->mu[k];
        c->cn[k] = f->c[k];
    }
    if (add_entries(&f->jc, c->contact_body, c->jn) ||
        add_entries(&f->jt, c->contact_body, c->jt) || add_entries(&f->je, c->joint_body, c->je)) {
        contact_case_free(c);
        return -1;
    }
    return 0;
}

static problem_triplets triplets(const double *rows, const int *body, int n, int n_bodies)
{
    problem_triplets t = {n, 3 * n_bodies, 0, NULL, NULL, NULL};
    const size_t most = 6 * (size_t)n + 1;
    t.i = malloc(most * sizeof(int));
    t.j = malloc(most * sizeof(int));
    t.x = malloc(most * sizeof(double));
    for (int k = 0; k < 6 * n; k++) {
        const int b = body[2 * (k / 6) + k % 6 / 3];
        if (b < 0 || rows[k] == 0) continue;
        t.i[t.n] = k / 6;
        t.j[t.n] = 3 * b + k % 3;
        t.x[t.n++] = rows[k];
    }
    return t;
}

static double *copy_of(const double *x, int n)
{
    double *y = malloc(((size_t)n + 1) * sizeof *y);
    if (n) memcpy(y, x, (size_t)n * sizeof *y);
    return y;
}

problem_file contact_case_to_file(const contact_case *c)
{
    const carom_contact_problem *p = &c->p;
    problem_file f;
    memset(&f, 0, sizeof f);
    f.n_bodies = p->n_bodies;
    f.n_contacts = p->n_contacts;
    f.n_joint_rows = p->n_joint_rows;
    f.M = copy_of(c->inv_mass, 3 * p->n_bodies);
    f.q = copy_of(c->u, 3 * p->n_bodies);
    f.mu = copy_of(c->mu, p->n_contacts);
    f.c = copy_of(c->cn, p->n_contacts);
    for (int i = 0; i < 3 * p->n_bodies; i++) {
        f.M[i] = 1 / f.M[i];
        f.q[i] *= -f.M[i];
    }
    f.jc = triplets(p->jn, p->contact_body, p->n_contacts, p->n_bodies);
    f.jt = triplets(p->jt, p->contact_body, p->n_contacts, p->n_bodies);
    f.je = triplets(p->je, p->joint_body, p->n_joint_rows, p->n_bodies);
    return f;
}

void contact_case_free_file(problem_file *f)
{
    problem_triplets *const t[] = {&f->jc, &f->jt, &f->je};
    for (int k = 0; k < 3; k++) {
        free(t[k]->i);
        free(t[k]->j);
        free(t[k]->x);
    }
    free(f->M);
    free(f->q);
    free(f->mu);
    free(f->c);
    memset(f, 0, sizeof *f);
}

typedef long double real;

/* row . x */
static real times(const double *row, const int *body, const double *x)
{
    real s = 0;
    for (int i = 0; i < 6; i++) {
        if (body[i / 3] >= 0) s += (real)row[i] * x[3 * body[i / 3] + i % 3];
    }
    return s;
}

static real weight(const double *row, const int *body, const double *w)
{
    real s = 0;
    for (int i = 0; i < 6; i++) {
        if (body[i / 3] >= 0) s += (real)row[i] * row[i] * w[3 * body[i / 3] + i % 3];
    }
    return s;
}

/* max(|J u|, |c|, 1e-5 |J| |u|) */
static real speed(const double *row, const int *body, const double *u, double c)
{
    real terms = 0;
    for (int i = 0; i < 6; i++) {
        if (body[i / 3] >= 0) terms += fabsl((real)row[i] * u[3 * body[i / 3] + i % 3]);
    }
    return fmaxl(fmaxl(fabsl(times(row, body, u)), fabsl(c)), 1e-5L * terms);
}

static real all_speed(const contact_case *c)
{
    const carom_contact_problem *p = &c->p;
    real v = 0;
    for (int k = 0; k < p->n_contacts; k++) {
        const int *b = p->contact_body + 2 * k;
        v = fmaxl(v, speed(p->jn + 6 * k, b, p->u, p->cn[k]));
        if (p->mu[k] > 0) v = fmaxl(v, speed(p->jt + 6 * k, b, p->u, p->ct ? p->ct[k] : 0));
    }
    for (int r = 0; r < p->n_joint_rows; r++) {
        const int *b = p->joint_body + 2 * r;
        v = fmaxl(v, speed(p->je + 6 * r, b, p->u, p->ce ? p->ce[r] : 0));
    }
    return v < 1e-200L ? 1 : v;
}

static real row_error(const contact_case *c)
{
    const carom_contact_problem *p = &c->p;
    real e = 0;
    for (int k = 0; k < p->n_contacts; k++) {
        const int *b = p->contact_body + 2 * k;
        const real a = times(p->jn + 6 * k, b, c->x.v) + p->cn[k];
        const real wn = weight(p->jn + 6 * k, b, p->inv_mass);
        const real wt = p->mu[k] > 0 ? weight(p->jt + 6 * k, b, p->inv_mass) : 0;
        e = fmaxl(e, fabsl(fminl(a, wn * c->x.ln[k])));
        if (wt == 0) continue;
        const real u = times(p->jt + 6 * k, b, c->x.v) + (p->ct ? p->ct[k] : 0);
        /* In double, as the multipliers are: they cannot be on the cone any better. */
        const double bound = p->mu[k] * fmax(c->x.ln[k], 0);
        const real t = fmaxl(-(real)bound, fminl(bound, c->x.lt[k] - u / wt));
        e = fmaxl(e, fabsl(wt * (c->x.lt[k] - t)));
    }
    for (int r = 0; r < p->n_joint_rows; r++) {
        const real a = times(p->je + 6 * r, p->joint_body + 2 * r, c->x.v);
        e = fmaxl(e, fabsl(a + (p->ce ? p->ce[r] : 0)));
    }
    return e;
}

/* J' l and |J|' |l| at one velocity. */
static void force(const contact_case *c, int at, real *sum, real *size)
{
    const carom_contact_problem *p = &c->p;
    *sum = 0;
    *size = 0;
    for (int k = 0; k < p->n_contacts; k++) {
        for (int i = at % 3; i < 6; i += 3) {
            if (p->contact_body[2 * k + i / 3] != at / 3) continue;
            const real n = (real)p->jn[6 * k + i] * c->x.ln[k];
            const real t = p->mu[k] > 0 ? (real)p->jt[6 * k + i] * c->x.lt[k] : 0;
            *sum += n + t;
            *size += fabsl(n) + fabsl(t);
        }
    }
    for (int r = 0; r < p->n_joint_rows; r++) {
        for (int i = at % 3; i < 6; i += 3) {
            if (p->joint_body[2 * r + i / 3] != at / 3) continue;
            const real e = (real)p->je[6 * r + i] * c->x.le[r];
            *sum += e;
            *size += fabsl(e);
        }
    }
}

static real motion_error(const contact_case *c)
{
    const carom_contact_problem *p = &c->p;
    real e = 0;
    real largest = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < 3 * p->n_bodies; i++) {
            const real w = p->inv_mass[i];
            real f;
            real size;
            force(c, i, &f, &size);
            const real terms = fabsl((real)c->x.v[i]) + fabsl((real)p->u[i]) + w * size;
            const real d = fabsl((real)c->x.v[i] - p->u[i] - w * f);
            if (!pass && w > 0) largest = fmaxl(largest, terms / sqrtl(w));
            if (pass && terms > 1e-14L * largest * sqrtl(w)) e = fmaxl(e, d / terms);
        }
    }
    return e;
}

double contact_case_residual(const contact_case *c)
{
    for (int i = 0; i < 3 * c->p.n_bodies; i++) {
        if (isnan(c->x.v[i])) return HUGE_VAL;
    }
    return (double)fmaxl(row_error(c) / all_speed(c), motion_error(c));
}
