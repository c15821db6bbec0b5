#include "libsolver/contact/block/graph.h"

/* Work of one analysis, behind the arrays of the graph in the same arena. */
typedef struct work {
    int *leader;  /* union-find over bodies */
    int *touched; /* per body: a row acts on it */
    int *island;  /* per body: its island, or -1 */
    int *next;    /* per island: next free slot */
    int *head;    /* per group: first row, in order of rows */
    int *length;  /* per group: rows */
} work;

static int axes_of(const double *w)
{
    return (w[0] > 0) + 2 * (w[1] > 0) + 4 * (w[2] > 0);
}

static void layout(crm_arena *a, crm_graph *g, work *k)
{
    const int nb = g->n_bodies;
    const int nc = g->n_contacts;
    const int nr = g->n_rows;
    g->contact_body = crm_arena_ints(a, 2 * nc);
    g->joint_body = crm_arena_ints(a, 2 * nr);
    g->axes = crm_arena_take(a, (size_t)nb, 1);
    g->node_ptr = crm_arena_ints(a, nb + 1);
    g->contact_ptr = crm_arena_ints(a, nb + 1);
    g->group_ptr = crm_arena_ints(a, nb + 1);
    g->node_of = crm_arena_ints(a, nb);
    g->body_of = crm_arena_ints(a, nb);
    g->contact_of = crm_arena_ints(a, nc);
    g->contact_node = crm_arena_ints(a, 2 * nc);
    g->group_row = crm_arena_ints(a, nr);
    g->group_size = crm_arena_ints(a, nr);
    g->group_node = crm_arena_ints(a, 2 * nr);
    k->leader = crm_arena_ints(a, nb);
    k->touched = crm_arena_ints(a, nb);
    k->island = crm_arena_ints(a, nb);
    k->next = crm_arena_ints(a, nb);
    k->head = crm_arena_ints(a, nr);
    k->length = crm_arena_ints(a, nr);
}

static int same_graph(const crm_graph *g, const carom_contact_problem *p)
{
    if (g->n_bodies != p->n_bodies || g->n_contacts != p->n_contacts ||
        g->n_rows != p->n_joint_rows)
        return 0;
    const size_t pair = 2 * sizeof(int);
    if (g->n_contacts && memcmp(g->contact_body, p->contact_body, (size_t)g->n_contacts * pair))
        return 0;
    if (g->n_rows && memcmp(g->joint_body, p->joint_body, (size_t)g->n_rows * pair)) return 0;
    for (int b = 0; b < g->n_bodies; b++) {
        if (g->axes[b] != axes_of(p->inv_mass + 3 * b)) return 0;
    }
    return 1;
}

static int find_leader(int *leader, int b)
{
    while (leader[b] != b) {
        leader[b] = leader[leader[b]];
        b = leader[b];
    }
    return b;
}

static int is_free(const crm_graph *g, int body)
{
    return body >= 0 && g->axes[body];
}

/* A row joins its free bodies; the smaller index leads. */
static void join_pairs(const crm_graph *g, work *k, int n, const int *body)
{
    for (int i = 0; i < n; i++) {
        const int a = body[2 * i];
        const int b = body[2 * i + 1];
        if (is_free(g, a)) k->touched[a] = 1;
        if (is_free(g, b)) k->touched[b] = 1;
        if (!is_free(g, a) || !is_free(g, b)) continue;
        const int la = find_leader(k->leader, a);
        const int lb = find_leader(k->leader, b);
        if (la < lb) k->leader[lb] = la;
        if (lb < la) k->leader[la] = lb;
    }
}

/* Consecutive rows of one pair, at most three, make a group. */
static int find_groups(const crm_graph *g, work *k)
{
    int n = 0;
    for (int r = 0; r < g->n_rows; r++) {
        const int *body = g->joint_body + 2 * r;
        if (n && k->length[n - 1] < CRM_GROUP_ROWS && body[0] == body[-2] && body[1] == body[-1]) {
            k->length[n - 1]++;
        } else {
            k->head[n] = r;
            k->length[n++] = 1;
        }
    }
    return n;
}

/* Island of a row: that of a free body, or -1. */
static int island_of(const crm_graph *g, const work *k, const int *body)
{
    if (is_free(g, body[0])) return k->island[body[0]];
    return is_free(g, body[1]) ? k->island[body[1]] : -1;
}

/* Counts in ptr[i + 1] become slices; next[i] starts each. */
static void make_slices(int n, int *ptr, int *next)
{
    for (int i = 0; i < n; i++) {
        next[i] = ptr[i];
        ptr[i + 1] += ptr[i];
    }
}

static void number_islands(crm_graph *g, work *k)
{
    g->n_islands = 0;
    g->n_nodes = 0;
    for (int b = 0; b < g->n_bodies; b++) {
        k->island[b] = -1;
        g->node_of[b] = -1;
        if (!k->touched[b]) continue;
        const int l = find_leader(k->leader, b);
        /* A leader is the smallest of its island, so it has its number already. */
        k->island[b] = l == b ? g->n_islands++ : k->island[l];
        g->n_nodes++;
    }
}

static void place_nodes(crm_graph *g, work *k)
{
    memset(g->node_ptr, 0, (size_t)(g->n_islands + 1) * sizeof(int));
    for (int b = 0; b < g->n_bodies; b++) {
        if (k->island[b] >= 0) g->node_ptr[k->island[b] + 1]++;
    }
    for (int i = 0; i < g->n_islands; i++) {
        k->next[i] = 0;
        g->node_ptr[i + 1] += g->node_ptr[i];
    }
    for (int b = 0; b < g->n_bodies; b++) {
        const int i = k->island[b];
        if (i < 0) continue;
        g->node_of[b] = k->next[i]++;
        g->body_of[g->node_ptr[i] + g->node_of[b]] = b;
    }
}

static int node_at(const crm_graph *g, int body)
{
    return body >= 0 ? g->node_of[body] : -1;
}

static void place_contacts(crm_graph *g, work *k)
{
    memset(g->contact_ptr, 0, (size_t)(g->n_islands + 1) * sizeof(int));
    for (int c = 0; c < g->n_contacts; c++) {
        const int i = island_of(g, k, g->contact_body + 2 * c);
        if (i >= 0) g->contact_ptr[i + 1]++;
    }
    make_slices(g->n_islands, g->contact_ptr, k->next);
    g->n_live = g->n_islands ? g->contact_ptr[g->n_islands] : 0;
    for (int c = 0; c < g->n_contacts; c++) {
        const int *body = g->contact_body + 2 * c;
        const int i = island_of(g, k, body);
        if (i < 0) continue;
        const int slot = k->next[i]++;
        g->contact_of[slot] = c;
        g->contact_node[2 * slot] = node_at(g, body[0]);
        g->contact_node[2 * slot + 1] = node_at(g, body[1]);
    }
}

static void place_groups(crm_graph *g, work *k, int n)
{
    int rows = 0;
    memset(g->group_ptr, 0, (size_t)(g->n_islands + 1) * sizeof(int));
    for (int q = 0; q < n; q++) {
        const int i = island_of(g, k, g->joint_body + 2 * k->head[q]);
        if (i < 0) continue;
        g->group_ptr[i + 1]++;
        rows += k->length[q];
    }
    make_slices(g->n_islands, g->group_ptr, k->next);
    g->n_groups = g->n_islands ? g->group_ptr[g->n_islands] : 0;
    g->n_fixed = g->n_contacts - g->n_live + g->n_rows - rows;
    for (int q = 0; q < n; q++) {
        const int *body = g->joint_body + 2 * k->head[q];
        const int i = island_of(g, k, body);
        if (i < 0) continue;
        const int slot = k->next[i]++;
        g->group_row[slot] = k->head[q];
        g->group_size[slot] = k->length[q];
        g->group_node[2 * slot] = node_at(g, body[0]);
        g->group_node[2 * slot + 1] = node_at(g, body[1]);
    }
}

static void analyze(crm_graph *g, work *k)
{
    for (int b = 0; b < g->n_bodies; b++) {
        k->leader[b] = b;
        k->touched[b] = 0;
    }
    join_pairs(g, k, g->n_contacts, g->contact_body);
    join_pairs(g, k, g->n_rows, g->joint_body);
    number_islands(g, k);
    place_nodes(g, k);
    place_contacts(g, k);
    place_groups(g, k, find_groups(g, k));
}

carom_status crm_graph_update(crm_memory *m, crm_graph *g, const carom_contact_problem *p,
                              int *same)
{
    *same = same_graph(g, p);
    if (*same) return CAROM_OK;
    work k;
    crm_arena measure = {0};
    g->n_bodies = p->n_bodies;
    g->n_contacts = p->n_contacts;
    g->n_rows = p->n_joint_rows;
    layout(&measure, g, &k);
    const carom_status s = crm_arena_reserve(m, &g->arena, measure.used);
    if (s < 0) {
        g->n_bodies = -1;
        return s;
    }
    layout(&g->arena, g, &k);
    const size_t pair = 2 * sizeof(int);
    if (g->n_contacts) memcpy(g->contact_body, p->contact_body, (size_t)g->n_contacts * pair);
    if (g->n_rows) memcpy(g->joint_body, p->joint_body, (size_t)g->n_rows * pair);
    for (int b = 0; b < g->n_bodies; b++) g->axes[b] = (unsigned char)axes_of(p->inv_mass + 3 * b);
    analyze(g, &k);
    return CAROM_OK;
}

void crm_graph_free(crm_memory *m, crm_graph *g)
{
    crm_arena_free(m, &g->arena);
}
