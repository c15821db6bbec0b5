/* box_tree.c: see box_tree.h. */
#include "world/box_tree.h"

#include <math.h>

/* A tree whose boxes have grown by this factor in sum is built anew. */
static const double LOOSE = 1.5;

static carom_box join(carom_box a, carom_box b)
{
    const carom_box c = {{fmin(a.lower.x, b.lower.x), fmin(a.lower.y, b.lower.y)},
                         {fmax(a.upper.x, b.upper.x), fmax(a.upper.y, b.upper.y)}};
    return c;
}

static int nodes_of(int leaves)
{
    return 2 * leaves - 1;
}

carom_status crm_box_tree_resize(crm_memory *m, crm_box_tree *t, int n)
{
    void *items = t->items;
    void *nodes = t->nodes;
    void *order = t->order;
    carom_status e = n > INT_MAX / 2 ? CAROM_E_MEMORY : CAROM_OK;
    if (!e) e = crm_reserve(m, &items, &t->max_items, n, sizeof *t->items);
    t->items = items;
    if (!e && n) e = crm_reserve(m, &nodes, &t->max_nodes, nodes_of(n), sizeof *t->nodes);
    t->nodes = nodes;
    if (!e) e = crm_reserve(m, &order, &t->max_order, n, sizeof *t->order);
    t->order = order;
    t->n = e ? 0 : n;
    return e;
}

void crm_box_tree_free(crm_memory *m, crm_box_tree *t)
{
    crm_free(m, t->items, (size_t)t->max_items, sizeof *t->items);
    crm_free(m, t->nodes, (size_t)t->max_nodes, sizeof *t->nodes);
    crm_free(m, t->order, (size_t)t->max_order, sizeof *t->order);
}

static carom_vec2 middle(const carom_box *b)
{
    const carom_vec2 c = {0.5 * b->lower.x + 0.5 * b->upper.x, 0.5 * b->lower.y + 0.5 * b->upper.y};
    return c;
}

/* Along x (axis 0) or y, ties by index; of an empty box 0. */
static int before(const crm_box_tree *t, int axis, int i, int j)
{
    const carom_vec2 a = middle(&t->items[i]);
    const carom_vec2 b = middle(&t->items[j]);
    double u = axis ? a.y : a.x;
    double v = axis ? b.y : b.x;
    if (isnan(u)) u = 0;
    if (isnan(v)) v = 0;
    return u != v ? u < v : i < j;
}

static int longer_axis(const crm_box_tree *t, const int *order, int n)
{
    carom_box all = {{HUGE_VAL, HUGE_VAL}, {-HUGE_VAL, -HUGE_VAL}};
    for (int k = 0; k < n; k++) {
        const carom_vec2 c = middle(&t->items[order[k]]);
        const carom_box b = {c, c};
        all = join(all, b);
    }
    return all.upper.y - all.lower.y > all.upper.x - all.lower.x;
}

static void swap(int *a, int *b)
{
    const int c = *a;
    *a = *b;
    *b = c;
}

/* Moves the m items that come first to the front: quickselect, the pivot the median of three. */
static void part(const crm_box_tree *t, int axis, int *order, int n, int m)
{
    int low = 0;
    int high = n - 1;
    while (low < high) {
        const int mid = low + (high - low) / 2;
        if (before(t, axis, order[mid], order[low])) swap(&order[mid], &order[low]);
        if (before(t, axis, order[high], order[low])) swap(&order[high], &order[low]);
        if (before(t, axis, order[high], order[mid])) swap(&order[high], &order[mid]);
        const int pivot = order[mid];
        int i = low;
        int j = high;
        while (i <= j) {
            while (before(t, axis, order[i], pivot)) i++;
            while (before(t, axis, pivot, order[j])) j--;
            if (i <= j) swap(&order[i++], &order[j--]);
        }
        if (m <= j) {
            high = j;
        } else if (m >= i) {
            low = i;
        } else {
            return;
        }
    }
}

static void split(crm_box_tree *t, int *order, int n)
{
    if (n < 2) return;
    const int half = n / 2;
    part(t, longer_axis(t, order, n), order, n, half);
    split(t, order, half);
    split(t, order + half, n - half);
}

/* Boxes of a subtree; the sum of their half perimeters. */
static double fit(crm_box_tree *t, int node, int first, int n)
{
    double sum = 0;
    if (n == 1) {
        t->nodes[node] = t->items[t->order[first]];
    } else {
        const int half = n / 2;
        const int right = node + 1 + nodes_of(half);
        sum = fit(t, node + 1, first, half) + fit(t, right, first + half, n - half);
        t->nodes[node] = join(t->nodes[node + 1], t->nodes[right]);
    }
    const carom_box *b = &t->nodes[node];
    return sum + (b->upper.x - b->lower.x) + (b->upper.y - b->lower.y);
}

void crm_box_tree_update(crm_box_tree *t)
{
    if (t->n == 0) return;
    if (t->n == t->n_built && fit(t, 0, 0, t->n) <= LOOSE * t->built) return;
    for (int k = 0; k < t->n; k++) t->order[k] = k;
    split(t, t->order, t->n);
    t->built = fit(t, 0, 0, t->n);
    t->n_built = t->n;
}

static carom_status descend(const crm_box_tree *t, crm_search *s, int node, int first, int n)
{
    if (n == 1) return s->visit(s, t->order[first]);
    const int half = n / 2;
    const int right = node + 1 + nodes_of(half);
    const double a = s->least(s, &t->nodes[node + 1]);
    const double b = s->least(s, &t->nodes[right]);
    carom_status e = CAROM_OK;
    for (int k = 0; k < 2 && e >= 0; k++) {
        const int go_right = (k == 1) != (b < a);
        if ((go_right ? b : a) > s->bound || (go_right ? b : a) == HUGE_VAL) continue;
        e = go_right ? descend(t, s, right, first + half, n - half)
                     : descend(t, s, node + 1, first, half);
    }
    return e;
}

carom_status crm_box_tree_search(const crm_box_tree *t, crm_search *s)
{
    if (t->n == 0) return CAROM_OK;
    const double least = s->least(s, &t->nodes[0]);
    if (least > s->bound || least == HUGE_VAL) return CAROM_OK;
    return descend(t, s, 0, 0, t->n);
}
