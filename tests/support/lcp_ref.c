#include "lcp_ref.h"

#include <math.h>
#include <string.h>

/* A pivot below this part of the largest makes a basis singular [1]. */
static const double PIVOT_TOL = 1e-13;

static void swap(double *a, double *b)
{
    const double t = *a;
    *a = *b;
    *b = t;
}

/* Moves the largest entry of rows and columns k.. of K to (k, k); col records columns. */
static double pivot(int n, int k, double *K, double *x, int *col)
{
    int r = k;
    int c = k;
    for (int i = k; i < n; i++)
        for (int j = k; j < n; j++)
            if (fabs(K[i * n + j]) > fabs(K[r * n + c])) {
                r = i;
                c = j;
            }
    for (int j = 0; j < n; j++) swap(&K[k * n + j], &K[r * n + j]);
    swap(&x[k], &x[r]);
    for (int i = 0; i < n; i++) swap(&K[i * n + k], &K[i * n + c]);
    const int t = col[k];
    col[k] = col[c];
    col[c] = t;
    return fabs(K[k * n + k]);
}

double lcp_ref_linear(int n, double *K, double *x)
{
    int col[LCP_REF_MAX];
    double u[LCP_REF_MAX];
    double top = 0.0;
    double low = 0.0;
    for (int i = 0; i < n; i++) col[i] = i;
    for (int k = 0; k < n; k++) {
        low = pivot(n, k, K, x, col);
        if (k == 0) top = low;
        if (!(low > 0.0)) return 0.0;
        for (int i = k + 1; i < n; i++) {
            const double l = K[i * n + k] / K[k * n + k];
            for (int j = k; j < n; j++) K[i * n + j] -= l * K[k * n + j];
            x[i] -= l * x[k];
        }
    }
    for (int k = n - 1; k >= 0; k--) {
        for (int j = k + 1; j < n; j++) x[k] -= K[k * n + j] * x[j];
        x[k] /= K[k * n + k];
    }
    for (int k = 0; k < n; k++) u[col[k]] = x[k];
    memcpy(x, u, (size_t)n * sizeof *x);
    return n ? low / top : 1.0;
}

/* The system of one basis, unknowns (x, w, y): w_i = z_i where `active` has bit i, else s_i. */
static void assemble(const lcp_ref *p, unsigned active, double *K, double *rhs)
{
    const int nx = p->n_x;
    const int nz = p->n_ineq;
    const int ny = p->n_eq;
    const int n = nx + nz + ny;
    memset(K, 0, (size_t)(n * n) * sizeof *K);
    for (int i = 0; i < nx; i++) {
        for (int j = 0; j < nx; j++) K[i * n + j] = p->M[i * nx + j];
        for (int j = 0; j < nz; j++)
            if (active >> j & 1u) K[i * n + nx + j] = p->G[j * nx + i];
        for (int j = 0; j < ny; j++) K[i * n + nx + nz + j] = p->A[j * nx + i];
        rhs[i] = -p->q[i];
    }
    for (int i = 0; i < nz; i++) {
        double *row = K + (nx + i) * n;
        for (int j = 0; j < nx; j++) row[j] = p->G[i * nx + j];
        for (int j = 0; j < nz; j++)
            if (active >> j & 1u) row[nx + j] = p->F[i * nz + j];
        if (!(active >> i & 1u)) row[nx + i] = 1.0;
        rhs[nx + i] = p->m[i];
    }
    for (int i = 0; i < ny; i++) {
        for (int j = 0; j < nx; j++) K[(nx + nz + i) * n + j] = p->A[i * nx + j];
        rhs[nx + nz + i] = p->b[i];
    }
}

int lcp_ref_solve(const lcp_ref *p, double tol, int n_max, lcp_ref_point *out)
{
    double K[LCP_REF_MAX * LCP_REF_MAX];
    double u[LCP_REF_MAX];
    const int n = p->n_x + p->n_ineq + p->n_eq;
    const double *w = u + p->n_x;
    int found = 0;
    for (unsigned active = 0; active < 1u << p->n_ineq; active++) {
        assemble(p, active, K, u);
        if (!(lcp_ref_linear(n, K, u) > PIVOT_TOL)) continue;
        int admissible = 1;
        for (int i = 0; i < p->n_ineq; i++) admissible = admissible && w[i] >= -tol;
        if (!admissible) continue;
        if (found < n_max) {
            lcp_ref_point *at = &out[found];
            memset(at, 0, sizeof *at);
            for (int i = 0; i < p->n_x; i++) at->x[i] = u[i];
            for (int i = 0; i < p->n_ineq; i++) (active >> i & 1u ? at->z : at->s)[i] = w[i];
            for (int i = 0; i < p->n_eq; i++) at->y[i] = w[p->n_ineq + i];
        }
        found++;
    }
    return found;
}
