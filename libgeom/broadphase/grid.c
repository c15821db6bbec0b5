/* grid.c: boxes in square cells, sorted by row and column.
 *
 * The cell's side c is a power of two that all boxes but a few fit in.  A box belongs to the cell
 * of its lower corner, (floor(x / c), floor(y / c)), and reaches no farther than the next column
 * and row, which is checked on the numbers themselves.  Then boxes that overlap are in neighboring
 * cells: with the boxes sorted by row and column, each is compared with those after it up to the
 * next column, and with three columns of the next row.  The few others, large or far away, are
 * compared with all.  Nothing is stored per cell, so memory is linear in the boxes wherever they
 * are. */
#include "broadphase/internal.h"

#include <math.h>

/* Boxes larger than a cell: 1 in 2048, and some.  More, and one grid does not fit. */
enum { LARGE_SHARE = 2048, LARGE_MIN = 16 };

/* Comparisons per box above which the cells are too crowded. */
enum { CROWDED = 64 };

/* Columns and rows are counted from a reference and must stay within this. */
static const double INDEX_MAX = 1073741824.0; /* 2^30 */

/* Binary exponents of doubles, frexp's: -1073 .. 1024. */
enum { EXPONENT_MIN = -1073, N_EXPONENTS = 2098, N_SAMPLES = 15, DIGIT = 11 };

typedef struct grid {
    double inverse; /* 1 / c */
    double x0;      /* reference cell */
    double y0;
    int column_bits;
} grid;

static int exponent_of(double size)
{
    int e;
    frexp(size, &e);
    return size > 0 ? e : EXPONENT_MIN; /* size <= 2^e */
}

static double size_of(const carom_box *b)
{
    const double w = b->upper.x - b->lower.x;
    const double h = b->upper.y - b->lower.y;
    return w > h ? w : h;
}

/* The least exponent that all but `n_large` of the boxes fit in. */
static int common_exponent(int n, const carom_box *boxes, int n_large)
{
    int count[N_EXPONENTS] = {0};
    int m = 0;
    for (int i = 0; i < n; i++) {
        const double size = size_of(&boxes[i]);
        if (crm_box_is_empty(&boxes[i])) continue;
        m++;
        count[size <= 1.7e308 ? exponent_of(size) - EXPONENT_MIN : N_EXPONENTS - 1]++;
    }
    int e = N_EXPONENTS - 1;
    for (int above = count[e]; e > 0 && above <= n_large && above < m; above += count[e]) e--;
    return e + EXPONENT_MIN;
}

/* Median and spread (without the two extremes) of the lower sides of some boxes. */
static void sample(int n, const carom_box *boxes, int along_y, double *median, double *spread)
{
    double x[N_SAMPLES];
    int m = 0;
    for (int k = 0; k < N_SAMPLES; k++) {
        const carom_box *b = &boxes[(int)((long)n * k / N_SAMPLES)];
        const double v = along_y ? b->lower.y : b->lower.x;
        if (crm_box_is_empty(b)) continue;
        int i = m++;
        for (; i > 0 && x[i - 1] > v; i--) x[i] = x[i - 1];
        x[i] = v;
    }
    *median = m ? x[m / 2] : 0;
    *spread = m > 3 ? x[m - 2] - x[1] : 0;
}

/* 0: no useful grid. */
static int choose_cells(int n, const carom_box *boxes, grid *g)
{
    double x;
    double y;
    double spread_x;
    double spread_y;
    sample(n, boxes, 0, &x, &spread_x);
    sample(n, boxes, 1, &y, &spread_y);
    const double spread = spread_x > spread_y ? spread_x : spread_y;
    int e = common_exponent(n, boxes, n / LARGE_SHARE + LARGE_MIN);
    /* Points need cells too: not so small that their number overflows. */
    if (!(spread < 1e300)) return 0;
    if (e < exponent_of(spread) - 28) e = exponent_of(spread) - 28;
    if (e < -1000 || e > 1000) return 0;
    g->inverse = ldexp(1.0, -e);
    g->x0 = floor(x * g->inverse);
    g->y0 = floor(y * g->inverse);
    return fabs(g->x0) < HUGE_VAL && fabs(g->y0) < HUGE_VAL;
}

/* Cell of a box that fits the grid; 0: it does not. */
static int cell_of(const grid *g, const carom_box *b, int *column, int *row)
{
    const double x = floor(b->lower.x * g->inverse);
    const double y = floor(b->lower.y * g->inverse);
    if (!(fabs(x - g->x0) < INDEX_MAX && fabs(y - g->y0) < INDEX_MAX)) return 0;
    if (!(floor(b->upper.x * g->inverse) <= x + 1)) return 0;
    if (!(floor(b->upper.y * g->inverse) <= y + 1)) return 0;
    *column = (int)(x - g->x0);
    *row = (int)(y - g->y0);
    return 1;
}

typedef struct range {
    int low;
    int high;
} range;

static void extend(range *r, int i)
{
    if (i < r->low) r->low = i;
    if (i > r->high) r->high = i;
}

/* Boxes of the grid go to order, the others to large; returns the number of the former, -1 when
 * there are too many others.  Columns and rows are kept in the keys, 32 bits each. */
static int assign_cells(carom_broadphase *bp, grid *g, int n, const carom_box *boxes,
                        range *columns, range *rows)
{
    const int large_max = n / LARGE_SHARE + LARGE_MIN + N_SAMPLES;
    int m = 0;
    int n_large = 0;
    for (int i = 0; i < n; i++) {
        int column;
        int row;
        if (crm_box_is_empty(&boxes[i])) continue;
        if (!cell_of(g, &boxes[i], &column, &row)) {
            if (n_large == large_max) return -1;
            bp->large.at[n_large++] = i;
            continue;
        }
        extend(columns, column);
        extend(rows, row);
        bp->order.at[m] = i;
        bp->key.at[m++] = (uint64_t)(uint32_t)row << 32 | (uint32_t)column;
    }
    bp->stats.n_large = n_large;
    return m;
}

static int bits_of(uint64_t x)
{
    int bits = 0;
    for (; x; x >>= 1) bits++;
    return bits;
}

/* row << column_bits | column, both from 1 on, so that neither neighbor carries over. */
static int make_keys(carom_broadphase *bp, grid *g, int m, range columns, range rows)
{
    g->column_bits = bits_of((uint64_t)((int64_t)columns.high - columns.low) + 2);
    for (int i = 0; i < m; i++) {
        const uint64_t k = bp->key.at[i];
        const int64_t column = (int64_t)(int32_t)(uint32_t)k - columns.low + 1;
        const int64_t row = (int64_t)(int32_t)(uint32_t)(k >> 32) - rows.low + 1;
        bp->key.at[i] = (uint64_t)row << g->column_bits | (uint64_t)column;
    }
    return g->column_bits + bits_of((uint64_t)((int64_t)rows.high - rows.low) + 1);
}

static void swap_keys(carom_broadphase *bp)
{
    const crm_keys key = bp->key;
    const crm_ints order = bp->order;
    bp->key = bp->other_key;
    bp->order = bp->other;
    bp->other_key = key;
    bp->other = order;
}

/* Radix sort by the lowest `bits`, stable: boxes of one cell stay in the order of their indices. */
static void sort_cells(carom_broadphase *bp, int m, int bits)
{
    for (int shift = 0; shift < bits; shift += DIGIT) {
        int count[(1 << DIGIT) + 1] = {0};
        for (int i = 0; i < m; i++) {
            count[(bp->key.at[i] >> shift & ((1 << DIGIT) - 1)) + 1]++;
        }
        for (int d = 0; d < 1 << DIGIT; d++) count[d + 1] += count[d];
        for (int i = 0; i < m; i++) {
            const uint64_t key = bp->key.at[i];
            const int to = count[key >> shift & ((1 << DIGIT) - 1)]++;
            bp->other_key.at[to] = key;
            bp->other.at[to] = bp->order.at[i];
        }
        swap_keys(bp);
    }
}

/* Number of comparisons that scan_cells will make; stops counting past the limit. */
static long count_tests(const carom_broadphase *bp, const grid *g, int m, long limit)
{
    const uint64_t *key = bp->key.at;
    const uint64_t row = (uint64_t)1 << g->column_bits;
    long tests = 0;
    int same = 0;
    int first = 0;
    int last = 0;
    for (int i = 0; i < m && tests <= limit; i++) {
        while (same < m && key[same] <= key[i] + 1) same++;
        while (first < m && key[first] < key[i] + row - 1) first++;
        while (last < m && key[last] <= key[i] + row + 1) last++;
        tests += same - i - 1 + last - first;
    }
    return tests;
}

static carom_status test_run(carom_broadphase *bp, int i, int from, uint64_t last, int m)
{
    const carom_box a = bp->sorted.at[i];
    for (int j = from; j < m && bp->key.at[j] <= last; j++) {
        if (!crm_box_overlaps(&a, &bp->sorted.at[j])) continue;
        const carom_status e = crm_pair_add(bp, bp->order.at[i], bp->order.at[j]);
        if (e) return e;
    }
    return CAROM_OK;
}

static carom_status scan_cells(carom_broadphase *bp, const grid *g, int m)
{
    const uint64_t *key = bp->key.at;
    const uint64_t row = (uint64_t)1 << g->column_bits;
    int first = 0;
    for (int i = 0; i < m; i++) {
        carom_status e = test_run(bp, i, i + 1, key[i] + 1, m);
        while (first < m && key[first] < key[i] + row - 1) first++;
        if (!e) e = test_run(bp, i, first, key[i] + row + 1, m);
        if (e) return e;
    }
    return CAROM_OK;
}

/* Each of the others against the grid's boxes and against those before it. */
static carom_status scan_large(carom_broadphase *bp, int m, const carom_box *boxes)
{
    for (int k = 0; k < bp->stats.n_large; k++) {
        const int i = bp->large.at[k];
        const carom_box a = boxes[i];
        for (int j = 0; j < m; j++) {
            if (!crm_box_overlaps(&a, &bp->sorted.at[j])) continue;
            const carom_status e = crm_pair_add(bp, i, bp->order.at[j]);
            if (e) return e;
        }
        for (int j = 0; j < k; j++) {
            if (!crm_box_overlaps(&a, &boxes[bp->large.at[j]])) continue;
            const carom_status e = crm_pair_add(bp, i, bp->large.at[j]);
            if (e) return e;
        }
        bp->stats.n_tests += m + k;
    }
    return CAROM_OK;
}

/* order and other change places, so they are of one size. */
static carom_status reserve(carom_broadphase *bp, int n)
{
    carom_status e = crm_ints_reserve(bp, &bp->order, n + 1);
    if (!e) e = crm_ints_reserve(bp, &bp->other, n + 1);
    if (!e) e = crm_keys_reserve(bp, &bp->key, n);
    if (!e) e = crm_keys_reserve(bp, &bp->other_key, n);
    if (!e) e = crm_boxes_reserve(bp, &bp->sorted, n);
    if (!e) e = crm_ints_reserve(bp, &bp->large, n / LARGE_SHARE + LARGE_MIN + N_SAMPLES);
    return e;
}

carom_status crm_grid_pairs(carom_broadphase *bp, int n, const carom_box *boxes, int *done)
{
    grid g;
    range columns = {INT32_MAX, INT32_MIN};
    range rows = {INT32_MAX, INT32_MIN};
    *done = 0;
    if (!choose_cells(n, boxes, &g)) return CAROM_OK;
    carom_status e = reserve(bp, n);
    if (e) return e;
    const int m = assign_cells(bp, &g, n, boxes, &columns, &rows);
    if (m < 0) return CAROM_OK;
    if (m) sort_cells(bp, m, make_keys(bp, &g, m, columns, rows));
    const long limit = (long)CROWDED * n;
    const long tests = m ? count_tests(bp, &g, m, limit) : 0;
    if (tests > limit) return CAROM_OK;
    for (int i = 0; i < m; i++) bp->sorted.at[i] = boxes[bp->order.at[i]];
    *done = 1;
    bp->stats.method = CAROM_GRID;
    bp->stats.n_tests = tests;
    e = m ? scan_cells(bp, &g, m) : CAROM_OK;
    return e ? e : scan_large(bp, m, boxes);
}
