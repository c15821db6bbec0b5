#include "lcp_file.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Arrays of a problem under construction. */
typedef struct build {
    crm_problems *problems;
    int n_bodies;
    int n_contacts;
    int n_joint_rows;
    double *inv_mass, *u, *jn, *jt, *mu, *cn, *je;
    int *contact_body, *joint_body;
} build;

static int read_array(crm_problems *problems, const crm_node *root, const char *key, int n,
                      double *x)
{
    const crm_node at = crm_member(root, key);
    if (!at.json) crm_fault(problems, &at, "must be given: an array of %d numbers", n);
    return crm_get_numbers(problems, &at, n, x);
}

/* Half of row `row` (0: A, 3: B) that belongs to `body`: the one it already has, or a free one. */
static int find_half(int *pair, int body)
{
    for (int h = 0; h < 2; h++) {
        if (pair[h] == body) return h;
    }
    for (int h = 0; h < 2; h++) {
        if (pair[h] < 0) {
            pair[h] = body;
            return h;
        }
    }
    return -1;
}

/* One triplet (i, j, x) into rows of 6; entries that stand twice add up. */
static void place_entry(build *b, const crm_node *at, json_int_t i, json_int_t j, double x,
                        int *pair, double *rows)
{
    const int body = (int)j / 3;
    const int half = find_half(&pair[2 * i], body);
    if (half < 0) {
        crm_fault(b->problems, at, "row %d touches more than two bodies", (int)i);
        return;
    }
    rows[6 * i + 3 * half + (int)j % 3] += x;
}

/* The sparse matrix `key` into rows; contacts share one pair for normal and tangent. */
static void read_matrix(build *b, const crm_node *root, const char *key, int n_rows, int *pair,
                        double *rows)
{
    const crm_node at = crm_member(root, key);
    const crm_node is = crm_member(&at, "i");
    const crm_node js = crm_member(&at, "j");
    const crm_node xs = crm_member(&at, "x");
    const int n = crm_length(&is);
    if (crm_length(&js) != n || crm_length(&xs) != n) {
        crm_fault(b->problems, &at, "i, j and x must have the same length");
        return;
    }
    for (int k = 0; k < n; k++) {
        const crm_node i_node = crm_item(&is, k);
        const crm_node j_node = crm_item(&js, k);
        const crm_node x_node = crm_item(&xs, k);
        json_int_t i = 0;
        json_int_t j = 0;
        double x = 0;
        if (crm_get_integer(b->problems, &i_node, 0, n_rows - 1, &i) &&
            crm_get_integer(b->problems, &j_node, 0, 3.0 * b->n_bodies - 1, &j) &&
            crm_get_number(b->problems, &x_node, &x)) {
            place_entry(b, &at, i, j, x, pair, rows);
        }
    }
}

static int matrix_rows(crm_problems *problems, const crm_node *root, const char *key)
{
    json_int_t rows = 0;
    const crm_node at = crm_member(root, key);
    const crm_node n = crm_member(&at, "rows");
    if (!n.json) crm_fault(problems, &n, "must be given: number of rows");
    return crm_get_integer(problems, &n, 0, INT_MAX / 6, &rows) ? (int)rows : 0;
}

/* All arrays from one block each of numbers and of indices. */
static void allocate(build *b, crm_lcp *lcp)
{
    const size_t nb = (size_t)b->n_bodies;
    const size_t nc = (size_t)b->n_contacts;
    const size_t ne = (size_t)b->n_joint_rows;
    const size_t n = 9 * nb + 16 * nc + 7 * ne;
    double *p = crm_resize(NULL, n, sizeof *p);
    memset(p, 0, n * sizeof *p);
    lcp->numbers = p;
    b->inv_mass = p;
    b->u = b->inv_mass + 3 * nb;
    lcp->solution.v = b->u + 3 * nb;
    b->jn = lcp->solution.v + 3 * nb;
    b->jt = b->jn + 6 * nc;
    b->mu = b->jt + 6 * nc;
    b->cn = b->mu + nc;
    lcp->solution.ln = b->cn + nc;
    lcp->solution.lt = lcp->solution.ln + nc;
    b->je = lcp->solution.lt + nc;
    lcp->solution.le = b->je + 6 * ne;
    lcp->bodies = crm_resize(NULL, 2 * (nc + ne), sizeof(int));
    for (size_t k = 0; k < 2 * (nc + ne); k++) lcp->bodies[k] = -1;
    b->contact_body = lcp->bodies;
    b->joint_body = lcp->bodies + 2 * nc;
    lcp->solution.mode = crm_resize(NULL, nc, 1);
    memset(lcp->solution.mode, 0, nc);
}

/* inv_mass holds M and u holds q on entry. */
static void free_motion(build *b)
{
    for (int i = 0; i < 3 * b->n_bodies; i++) {
        const double m = b->inv_mass[i];
        if (!(m > 0)) {
            crm_fault(b->problems, NULL, "M[%d]: must be > 0, is %.17g", i, m);
            return;
        }
        b->inv_mass[i] = 1 / m;
        b->u[i] = -b->u[i] / m;
    }
}

static void publish(const build *b, carom_contact_problem *p)
{
    p->n_bodies = b->n_bodies;
    p->n_contacts = b->n_contacts;
    p->n_joint_rows = b->n_joint_rows;
    p->inv_mass = b->inv_mass;
    p->u = b->u;
    p->contact_body = b->contact_body;
    p->jn = b->jn;
    p->jt = b->jt;
    p->mu = b->mu;
    p->cn = b->cn;
    p->joint_body = b->joint_body;
    p->je = b->je;
}

static void read_problem(crm_problems *problems, const json_t *json, crm_lcp *lcp)
{
    const crm_node root = crm_root(json);
    const crm_node mass = crm_member(&root, "M");
    build b;
    memset(&b, 0, sizeof b);
    b.problems = problems;
    b.n_bodies = crm_length(&mass) / 3;
    b.n_contacts = matrix_rows(problems, &root, "J_c");
    b.n_joint_rows = matrix_rows(problems, &root, "J_e");
    if (problems->count) return;
    allocate(&b, lcp);
    if (!read_array(problems, &root, "M", 3 * b.n_bodies, b.inv_mass) ||
        !read_array(problems, &root, "q", 3 * b.n_bodies, b.u) ||
        !read_array(problems, &root, "mu", b.n_contacts, b.mu) ||
        !read_array(problems, &root, "c", b.n_contacts, b.cn)) {
        return;
    }
    read_matrix(&b, &root, "J_c", b.n_contacts, b.contact_body, b.jn);
    read_matrix(&b, &root, "J_t", b.n_contacts, b.contact_body, b.jt);
    read_matrix(&b, &root, "J_e", b.n_joint_rows, b.joint_body, b.je);
    free_motion(&b);
    publish(&b, &lcp->problem);
}

int crm_lcp_read(crm_problems *problems, crm_lcp *lcp)
{
    memset(lcp, 0, sizeof *lcp);
    json_t *json = crm_json_load(problems);
    if (!json) return 0;
    const char *name = json_string_value(json_object_get(json, "name"));
    if (!name) name = problems->file;
    lcp->name = crm_resize(NULL, strlen(name) + 1, 1);
    strcpy(lcp->name, name);
    read_problem(problems, json, lcp);
    json_decref(json);
    return problems->count == 0;
}

void crm_lcp_free(crm_lcp *lcp)
{
    free(lcp->name);
    free(lcp->numbers);
    free(lcp->bodies);
    free(lcp->solution.mode);
    memset(lcp, 0, sizeof *lcp);
}
