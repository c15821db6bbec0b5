#include "lcp/file.h"
#include "io/memory.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

static double *read_array(crm_problems *problems, const crm_node *root, const char *key, int n)
{
    const crm_node at = crm_member(root, key);
    double *x = crm_resize(NULL, (size_t)n, sizeof *x);
    if (!at.json) crm_fault(problems, &at, "must be given: an array of %d numbers", n);
    crm_get_numbers(problems, &at, n, x);
    return x;
}

/* Entry k of the matrix `at`. */
static void read_entry(crm_problems *problems, const crm_node *at, int k, int n_cols,
                       crm_triplets *m)
{
    const crm_node is = crm_member(at, "i");
    const crm_node js = crm_member(at, "j");
    const crm_node xs = crm_member(at, "x");
    const crm_node i_node = crm_item(&is, k);
    const crm_node j_node = crm_item(&js, k);
    const crm_node x_node = crm_item(&xs, k);
    json_int_t i = 0;
    json_int_t j = 0;
    crm_get_integer(problems, &i_node, 0, m->n_rows - 1, &i);
    crm_get_integer(problems, &j_node, 0, n_cols - 1, &j);
    crm_get_number(problems, &x_node, &m->x[k]);
    m->i[k] = (int)i;
    m->j[k] = (int)j;
}

static crm_triplets read_matrix(crm_problems *problems, const crm_node *root, const char *key,
                                int n_cols)
{
    crm_triplets m = {0, 0, NULL, NULL, NULL};
    const crm_node at = crm_member(root, key);
    const crm_node rows = crm_member(&at, "rows");
    const crm_node is = crm_member(&at, "i");
    const crm_node js = crm_member(&at, "j");
    const crm_node xs = crm_member(&at, "x");
    json_int_t n_rows = 0;
    if (!rows.json) crm_fault(problems, &rows, "must be given: number of rows");
    if (!crm_get_integer(problems, &rows, 0, INT_MAX / 8, &n_rows)) return m;
    const int n = crm_length(&is);
    if (crm_length(&js) != n || crm_length(&xs) != n) {
        crm_fault(problems, &at, "i, j and x must have the same length");
        return m;
    }
    m.n_rows = (int)n_rows;
    m.count = n;
    m.i = crm_resize(NULL, (size_t)n, sizeof *m.i);
    m.j = crm_resize(NULL, (size_t)n, sizeof *m.j);
    m.x = crm_resize(NULL, (size_t)n, sizeof *m.x);
    memset(m.x, 0, (size_t)n * sizeof *m.x);
    for (int k = 0; k < n; k++) read_entry(problems, &at, k, n_cols, &m);
    return m;
}

static void check_numbers(crm_problems *problems, const crm_lcp *p)
{
    for (int k = 0; k < 3 * p->n_bodies; k++) {
        if (p->mass[k] > 0) continue;
        crm_fault(problems, NULL, "M[%d]: must be > 0, is %.17g", k, p->mass[k]);
        break;
    }
    for (int k = 0; k < p->n_contacts; k++) {
        if (p->mu[k] >= 0) continue;
        crm_fault(problems, NULL, "mu[%d]: must be >= 0, is %.17g", k, p->mu[k]);
        break;
    }
    if (p->jt.n_rows != p->n_contacts) {
        crm_fault(problems, NULL, "J_t.rows: must be %d as in J_c, is %d", p->n_contacts,
                  p->jt.n_rows);
    }
}

int crm_lcp_read(crm_problems *problems, crm_lcp *lcp)
{
    memset(lcp, 0, sizeof *lcp);
    json_t *json = crm_json_load_python(problems);
    if (!json) return 0;
    const crm_node root = crm_root(json);
    const crm_node mass = crm_member(&root, "M");
    const char *name = json_string_value(json_object_get(json, "name"));
    if (!name) name = problems->file;
    lcp->name = crm_resize(NULL, strlen(name) + 1, 1);
    strcpy(lcp->name, name);
    const int n = crm_length(&mass) / 3;
    lcp->n_bodies = n;
    lcp->jn = read_matrix(problems, &root, "J_c", 3 * n);
    lcp->jt = read_matrix(problems, &root, "J_t", 3 * n);
    lcp->je = read_matrix(problems, &root, "J_e", 3 * n);
    lcp->n_contacts = lcp->jn.n_rows;
    lcp->n_joint_rows = lcp->je.n_rows;
    lcp->mass = read_array(problems, &root, "M", 3 * n);
    lcp->q = read_array(problems, &root, "q", 3 * n);
    lcp->mu = read_array(problems, &root, "mu", lcp->n_contacts);
    lcp->c = read_array(problems, &root, "c", lcp->n_contacts);
    if (!crm_faulty(problems)) check_numbers(problems, lcp);
    json_decref(json);
    return !crm_faulty(problems);
}

static void free_triplets(crm_triplets *m)
{
    free(m->i);
    free(m->j);
    free(m->x);
}

void crm_lcp_free(crm_lcp *lcp)
{
    free(lcp->name);
    free(lcp->mass);
    free(lcp->q);
    free(lcp->mu);
    free(lcp->c);
    free_triplets(&lcp->jn);
    free_triplets(&lcp->jt);
    free_triplets(&lcp->je);
    memset(lcp, 0, sizeof *lcp);
}

carom_contact_solution crm_lcp_room(const crm_lcp *lcp)
{
    const size_t n_v = 3 * (size_t)lcp->n_bodies;
    const size_t n_c = (size_t)lcp->n_contacts;
    const size_t n = n_v + 2 * n_c + (size_t)lcp->n_joint_rows;
    carom_contact_solution x;
    x.v = crm_resize(NULL, n, sizeof(double));
    memset(x.v, 0, n * sizeof(double));
    x.ln = x.v + n_v;
    x.lt = x.ln + n_c;
    x.le = x.lt + n_c;
    x.mode = crm_resize(NULL, n_c, 1);
    memset(x.mode, 0, n_c);
    return x;
}

void crm_lcp_room_free(carom_contact_solution *x)
{
    free(x->v);
    free(x->mode);
    memset(x, 0, sizeof *x);
}
