#include "four_variables.h"

#include <stdlib.h>
#include <string.h>

/* Compressed columns of t, appended to ints and reals. */
static carom_sparse compress(const problem_triplets *t, int **ints, double **reals)
{
    int *col = *ints;
    int *row = col + t->n_cols + 1;
    double *val = *reals;
    *ints = row + t->n;
    *reals = val + t->n;
    memset(col, 0, ((size_t)t->n_cols + 1) * sizeof *col);
    for (int k = 0; k < t->n; k++) col[t->j[k] + 1]++;
    for (int j = 0; j < t->n_cols; j++) col[j + 1] += col[j];
    for (int j = 0, p = 0; j < t->n_cols; j++)
        for (int k = 0; k < t->n; k++)
            if (t->j[k] == j) {
                row[p] = t->i[k];
                val[p++] = t->x[k];
            }
    const carom_sparse a = {col, row, val};
    return a;
}

static void put(problem_triplets *t, int i, int j, double x)
{
    t->i[t->n] = i;
    t->j[t->n] = j;
    t->x[t->n] = x;
    t->n++;
}

/* G = -[J_n; J_t, -J_t alternating; 0] */
static void fill_g(const problem_file *p, problem_triplets *t)
{
    const int n = p->n_contacts;
    for (int k = 0; k < p->jc.n; k++) put(t, p->jc.i[k], p->jc.j[k], -p->jc.x[k]);
    for (int k = 0; k < p->jt.n; k++) {
        put(t, n + 2 * p->jt.i[k], p->jt.j[k], -p->jt.x[k]);
        put(t, n + 2 * p->jt.i[k] + 1, p->jt.j[k], p->jt.x[k]);
    }
}

static void fill_f(const problem_file *p, problem_triplets *t)
{
    const int n = p->n_contacts;
    for (int k = 0; k < n; k++) {
        const int plus = n + 2 * k;
        const int g = 3 * n + k;
        put(t, plus, g, -1.0);
        put(t, plus + 1, g, -1.0);
        put(t, g, k, -p->mu[k]);
        put(t, g, plus, 1.0);
        put(t, g, plus + 1, 1.0);
    }
}

int four_variables_make(const problem_file *p, four_variables *f)
{
    const int nv = 3 * p->n_bodies;
    const int nz = 4 * p->n_contacts;
    const size_t entries = (size_t)(nv + p->je.n + p->jc.n + 2 * p->jt.n + 5 * p->n_contacts);
    const size_t columns = (size_t)(3 * (nv + 1) + nz + 1);
    int *scratch_i = malloc((entries + 1) * sizeof *scratch_i);
    int *scratch_j = malloc((entries + 1) * sizeof *scratch_j);
    double *scratch_x = malloc((entries + 1) * sizeof *scratch_x);
    int *ints = f->ints = malloc((columns + entries) * sizeof *ints);
    double *reals = f->reals =
        malloc((entries + (size_t)(nz + p->n_joint_rows + 1)) * sizeof *reals);
    const int ready = scratch_i && scratch_j && scratch_x && ints && reals;
    if (ready) {
        problem_triplets t = {nv, nv, 0, scratch_i, scratch_j, scratch_x};
        for (int i = 0; i < nv; i++) put(&t, i, i, p->M[i]);
        f->problem.M = compress(&t, &ints, &reals);
        f->problem.A = compress(&p->je, &ints, &reals);
        t.n_rows = nz;
        t.n = 0;
        fill_g(p, &t);
        f->problem.G = compress(&t, &ints, &reals);
        t.n_cols = nz;
        t.n = 0;
        fill_f(p, &t);
        f->problem.F = compress(&t, &ints, &reals);
        f->problem.n_x = nv;
        f->problem.n_ineq = nz;
        f->problem.n_eq = p->n_joint_rows;
        f->problem.q = p->q;
        memset(reals, 0, (size_t)(nz + p->n_joint_rows) * sizeof *reals);
        memcpy(reals, p->c, (size_t)p->n_contacts * sizeof *reals);
        f->problem.m = reals;
        f->problem.b = reals + nz;
    }
    free(scratch_i);
    free(scratch_j);
    free(scratch_x);
    if (!ready) four_variables_free(f);
    return ready ? 0 : -1;
}

void four_variables_free(four_variables *f)
{
    free(f->ints);
    free(f->reals);
    memset(f, 0, sizeof *f);
}
