#include "libsolver/contact/block/block_lu.h"

/* Work of one analysis; an island's part starts at 0 of each. */
typedef struct work {
    int *ap; /* block n + 1: neighbors */
    int *ai;
    int *end;    /* per block: end of its list while it fills */
    int *order;  /* position -> block */
    int *parent; /* elimination tree */
    int *mark;
    int *count;
    unsigned char *full;
    int *scratch;
} work;

/* Sizes: the whole graph bounds each island. */
static void layout(crm_arena *a, crm_block_pattern *s, const crm_graph *g, work *k)
{
    const int n = g->n_nodes + g->n_groups;
    const int nz = 2 * g->n_live + 4 * g->n_groups;
    s->place = crm_arena_ints(a, n);
    s->lp = crm_arena_ints(a, n + 1);
    s->contact_target = crm_arena_ints(a, g->n_live);
    s->group_target = crm_arena_ints(a, 2 * g->n_groups);
    k->ap = crm_arena_ints(a, n + 1);
    k->ai = crm_arena_ints(a, nz);
    k->end = crm_arena_ints(a, n);
    k->order = crm_arena_ints(a, n);
    k->parent = crm_arena_ints(a, n);
    k->mark = crm_arena_ints(a, n);
    k->count = crm_arena_ints(a, n);
    k->full = crm_arena_take(a, (size_t)n, 1);
    k->scratch = crm_arena_take(a, crm_block_order_scratch(n, nz), sizeof(int));
}

static void link_both(work *k, int i, int j)
{
    k->ai[k->end[i]++] = j;
    k->ai[k->end[j]++] = i;
}

/* Calls for every pair of blocks that shares an entry: counts (fill = 0) or links. */
static void each_pair(const crm_graph *g, int island, work *k, int fill)
{
    const int n_nodes = g->node_ptr[island + 1] - g->node_ptr[island];
    for (int c = g->contact_ptr[island]; c < g->contact_ptr[island + 1]; c++) {
        const int *v = g->contact_node + 2 * c;
        if (v[0] < 0 || v[1] < 0) continue;
        if (fill) {
            link_both(k, v[0], v[1]);
        } else {
            k->count[v[0]]++;
            k->count[v[1]]++;
        }
    }
    for (int q = g->group_ptr[island]; q < g->group_ptr[island + 1]; q++) {
        const int id = n_nodes + q - g->group_ptr[island];
        for (int e = 0; e < 2; e++) {
            const int v = g->group_node[2 * q + e];
            if (v < 0) continue;
            if (fill) {
                link_both(k, id, v);
            } else {
                k->count[id]++;
                k->count[v]++;
            }
        }
    }
}

/* Removes repeated neighbors in place. */
static void drop_repeats(int n, work *k)
{
    int z = 0;
    for (int i = 0; i < n; i++) k->mark[i] = -1;
    for (int i = 0; i < n; i++) {
        const int from = k->ap[i];
        const int to = k->end[i];
        k->ap[i] = z;
        for (int p = from; p < to; p++) {
            const int j = k->ai[p];
            if (k->mark[j] == i) continue;
            k->mark[j] = i;
            k->ai[z++] = j;
        }
    }
    k->ap[n] = z;
}

static void find_neighbors(const crm_graph *g, int island, int n, work *k)
{
    for (int i = 0; i < n; i++) k->count[i] = 0;
    each_pair(g, island, k, 0);
    k->ap[0] = 0;
    for (int i = 0; i < n; i++) {
        k->ap[i + 1] = k->ap[i] + k->count[i];
        k->end[i] = k->ap[i];
    }
    each_pair(g, island, k, 1);
    drop_repeats(n, k);
}

/* Row i of L is what the elimination tree reaches from the row's entries: walks it, counting the
 * columns (li NULL) or filling them.  Rows come in order, so columns come out sorted. */
static void walk_rows(int n, const int *place, work *k, const int *lp, int *li)
{
    for (int i = 0; i < n; i++) {
        k->mark[i] = -1;
        k->count[i] = 0;
        if (!li) k->parent[i] = -1;
    }
    for (int i = 0; i < n; i++) {
        const int block = k->order[i];
        k->mark[i] = i;
        for (int p = k->ap[block]; p < k->ap[block + 1]; p++) {
            for (int j = place[k->ai[p]]; j < i && k->mark[j] != i; j = k->parent[j]) {
                if (k->parent[j] < 0) k->parent[j] = i;
                if (li) li[lp[j] + k->count[j]] = i;
                k->count[j]++;
                k->mark[j] = i;
            }
        }
    }
}

/* Block (row, column) by binary search in the column of the earlier one. */
static int target_of(const crm_block_pattern *s, const int *lp, int row, int column)
{
    const int i = row > column ? row : column;
    const int j = row > column ? column : row;
    int low = lp[j];
    int high = lp[j + 1] - 1;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (s->li[middle] < i)
            low = middle + 1;
        else
            high = middle;
    }
    return row > column ? low : -1 - low;
}

static void find_targets(const crm_graph *g, int island, crm_block_pattern *s)
{
    const int n_nodes = g->node_ptr[island + 1] - g->node_ptr[island];
    const int first = g->node_ptr[island] + g->group_ptr[island];
    const int *place = s->place + first;
    const int *lp = s->lp + first;
    for (int c = g->contact_ptr[island]; c < g->contact_ptr[island + 1]; c++) {
        const int *v = g->contact_node + 2 * c;
        s->contact_target[c] =
            v[0] < 0 || v[1] < 0 ? 0 : target_of(s, lp, place[v[0]], place[v[1]]);
    }
    for (int q = g->group_ptr[island]; q < g->group_ptr[island + 1]; q++) {
        const int id = n_nodes + q - g->group_ptr[island];
        for (int e = 0; e < 2; e++) {
            const int v = g->group_node[2 * q + e];
            s->group_target[2 * q + e] = v < 0 ? 0 : target_of(s, lp, place[id], place[v]);
        }
    }
}

static carom_status analyze_island(crm_memory *m, crm_block_pattern *s, const crm_graph *g,
                                   int island, work *k)
{
    const int n_nodes = g->node_ptr[island + 1] - g->node_ptr[island];
    const int first = g->node_ptr[island] + g->group_ptr[island];
    const int n = g->node_ptr[island + 1] + g->group_ptr[island + 1] - first;
    find_neighbors(g, island, n, k);
    for (int v = 0; v < n_nodes; v++)
        k->full[v] = g->axes[g->body_of[g->node_ptr[island] + v]] == 7;
    const crm_block_graph graph = {n, n_nodes, k->ap, k->ai, k->full};
    crm_block_order(&graph, k->order, k->scratch);
    int *place = s->place + first;
    int *lp = s->lp + first;
    for (int i = 0; i < n; i++) place[k->order[i]] = i;
    walk_rows(n, place, k, lp, NULL);
    for (int i = 0; i < n; i++) lp[i + 1] = lp[i] + k->count[i];
    const carom_status status = crm_reserve(m, (void **)&s->li, &s->li_max, lp[n], sizeof(int));
    if (status < 0) return status;
    walk_rows(n, place, k, lp, s->li);
    find_targets(g, island, s);
    return CAROM_OK;
}

carom_status crm_block_analyze(crm_memory *m, crm_block_pattern *s, const crm_graph *g)
{
    work k;
    crm_arena measure = {0};
    layout(&measure, s, g, &k);
    carom_status status = crm_arena_reserve(m, &s->arena, measure.used);
    if (status < 0) return status;
    layout(&s->arena, s, g, &k);
    s->n = g->n_nodes + g->n_groups;
    s->lp[0] = 0;
    for (int i = 0; i < g->n_islands && status >= 0; i++) status = analyze_island(m, s, g, i, &k);
    return status;
}

void crm_block_pattern_free(crm_memory *m, crm_block_pattern *s)
{
    crm_arena_free(m, &s->arena);
    crm_free(m, s->li, (size_t)s->li_max, sizeof(int));
    s->li = NULL;
    s->li_max = 0;
}
