/* carom::solver alone: a block of 2 kg that slides on the floor loses mu g h of its speed. */
#include <carom/contact.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

int main(void)
{
    const double h = 0.01, g = 10.0, friction = 0.5;
    const double inv_mass[3] = {0.0, 0.5, 0.5}; /* it does not turn */
    const double u[3] = {0.0, 3.0, -g * h};
    const int bodies[2] = {-1, 0}; /* A the world, B the block; the normal points up */
    const double jn[6] = {0, 0, 0, 0, 0, 1};
    const double jt[6] = {0, 0, 0, 0, -1, 0};
    const double cn[1] = {0.0};
    double v[3], ln[1], lt[1], le[1];
    unsigned char mode[1] = {0};
    carom_contact_problem p;
    carom_contact_solution x;
    carom_contact_solver *solver = NULL;
    carom_status s;

    memset(&p, 0, sizeof p);
    memset(&x, 0, sizeof x);
    p.n_bodies = 1;
    p.n_contacts = 1;
    p.inv_mass = inv_mass;
    p.u = u;
    p.contact_body = bodies;
    p.jn = jn;
    p.jt = jt;
    p.mu = &friction;
    p.cn = cn;
    x.v = v;
    x.ln = ln;
    x.lt = lt;
    x.le = le;
    x.mode = mode;
    if (carom_contact_create(NULL, NULL, &solver) != CAROM_OK) return 1;
    s = carom_contact_solve(solver, &p, 0, &x, NULL);
    carom_contact_destroy(solver);
    printf("%s: v = (%.12g, %.12g), l_n = %.12g\n", carom_status_text(s), v[1], v[2], ln[0]);
    /* Accepted at a scaled residual of 1e-10; the speeds are of order 1. */
    return !(s == CAROM_OK && fabs(v[1] - (3.0 - friction * g * h)) < 1e-9 && fabs(v[2]) < 1e-9 &&
             fabs(ln[0] - 2.0 * g * h) < 1e-9);
}
