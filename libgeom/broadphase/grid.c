/* grid.c: boxes in rows and columns, sorted.
 *
 * Rows have the height c of the largest box but a few, columns a width of c / 8.  A box belongs to
 * the row and column of its lower corner; that it reaches no farther than the next row and 9
 * columns on is checked on the numbers themselves.  All roundings are monotone, so boxes that
 * overlap meet in these indices.  With the boxes sorted by row and column, each is compared with
 * those after it in its row up to its last column, and with those of the next row from 9 columns
 * before.  The few others, large or far away, are compared with all.  Nothing is stored per cell:
 * memory is linear in the boxes wherever they are. */
#include "broadphase/internal.h"

#include <math.h>

/* Boxes that do not fit: 1 in 2048, and some.  More, and one grid is not for these boxes. */
enum { LARGE_SHARE = 2048, LARGE_MIN = 16 };

/* Comparisons per box above which the rows are too crowded. */
enum { CROWDED = 64 };

/* Columns per row height; columns that a box may span beyond its first. */
enum { FINE = 8, SPAN_MAX = 9, SPAN_BITS = 4 };

/* Rows and columns are counted from a reference and must stay within this. */
static const double INDEX_MAX = 268435456.0; /* 2^28 */

enum { N_SAMPLES = 15, DIGIT = 11 };

typedef struct grid {
    double x0; /* reference */
    double y0;
    double per_column; /* 1 / width */
    double per_row;
    int column_bits;
} grid;

static double size_of(const carom_box *b)
{
    const double w = b->upper.x - b->lower.x;
    const double h = b->upper.y - b->lower.y;
    return w > h ? w : h;
}

/* The biased exponent of a size >= 0: in the order of the sizes; infinity last. */
static int octave(double size)
{
    uint64_t bits;
    memcpy(&bits, &size, sizeof bits);
    return (int)(bits >> 52 & 2047);
}

/* The least octave that all but n_large of the boxes are within. */
static int common_octave(int n, const carom_box *boxes, int n_large)
{
    int count[2048] = {0};
    int m = 0;
    for (int i = 0; i < n; i++) {
        if (crm_box_is_empty(&boxes[i])) continue;
        count[octave(size_of(&boxes[i]))]++;
        m++;
    }
    int top = 2047;
    for (int above = count[top]; top > 0 && above <= n_large && above < m; above += count[top])
        top--;
    return top;
}

/* The largest size within the octave. */
static double largest_within(int n, const carom_box *boxes, int top)
{
    double largest = 0;
    for (int i = 0; i < n; i++) {
        const double size = size_of(&boxes[i]);
        if (size > largest && octave(size) <= top) largest = size;
    }
    return largest;
}

/* Median and spread (without the two extremes) of the lower sides of some boxes. */
static void sample(int n, const carom_box *boxes, int along_y, double *median, double *spread)
{
    double x[N_SAMPLES];
    int m = 0;
    for (int k = 0; k < N_SAMPLES; k++) {
        const carom_box *b = &boxes[(int)((int64_t)n * k / N_SAMPLES)];
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
static int choose_rows(int n, const carom_box *boxes, grid *g)
{
    double spread_x;
    double spread_y;
    sample(n, boxes, 0, &g->x0, &spread_x);
    sample(n, boxes, 1, &g->y0, &spread_y);
    const double spread = spread_x > spread_y ? spread_x : spread_y;
    const int top = common_octave(n, boxes, n / LARGE_SHARE + LARGE_MIN);
    double c = largest_within(n, boxes, top) * (1 + 1e-6);
    /* Points need rows too: not so low that their number overflows. */
    if (c < spread / (INDEX_MAX / 64)) c = spread / (INDEX_MAX / 64);
    g->per_row = 1 / c;
    g->per_column = FINE / c;
    return g->per_row > 1e-300 && g->per_column < 1e300 && fabs(g->x0) < HUGE_VAL &&
           fabs(g->y0) < HUGE_VAL;
}

static int floor_of(double v)
{
    const int k = (int)v;
    return k - (v < k);
}

typedef struct place {
    int column;
    int row;
    int span; /* columns beyond the first */
} place;

/* 0: the box does not fit the grid. */
static int place_of(const grid *g, const carom_box *b, place *p)
{
    const double x = (b->lower.x - g->x0) * g->per_column;
    const double y = (b->lower.y - g->y0) * g->per_row;
    const double x1 = (b->upper.x - g->x0) * g->per_column;
    const double y1 = (b->upper.y - g->y0) * g->per_row;
    if (!(x > -INDEX_MAX && x1 < INDEX_MAX && y > -INDEX_MAX && y1 < INDEX_MAX)) return 0;
    p->column = floor_of(x);
    p->row = floor_of(y);
    p->span = floor_of(x1) - p->column;
    return p->span <= SPAN_MAX && floor_of(y1) <= p->row + 1;
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

static int bits_of(int x)
{
    int bits = 0;
    for (; x; x >>= 1) bits++;
    return bits;
}

/* Boxes of the grid go to order, the others to large; returns the number of the former, -1 when
 * there are too many others. */
static int split(carom_broadphase *bp, const grid *g, int n, const carom_box *boxes, range *columns,
                 range *rows)
{
    const int large_max = n / LARGE_SHARE + LARGE_MIN + N_SAMPLES;
    int m = 0;
    int n_large = 0;
    for (int i = 0; i < n; i++) {
        place p;
        if (crm_box_is_empty(&boxes[i])) continue;
        if (place_of(g, &boxes[i], &p)) {
            extend(columns, p.column);
            extend(rows, p.row);
            bp->order.at[m++] = i;
        } else if (n_large < large_max) {
            bp->large.at[n_large++] = i;
        } else {
            return -1;
        }
    }
    bp->stats.n_large = n_large;
    return m;
}

/* Keys: row, column, span from high to low; columns leave room on both sides, so that no neighbor
 * is in another row.  Returns the number of bits. */
static int make_keys(carom_broadphase *bp, grid *g, int m, const carom_box *boxes, range columns,
                     range rows)
{
    g->column_bits = bits_of(columns.high - columns.low + 2 * SPAN_MAX);
    for (int i = 0; i < m; i++) {
        place p = {0, 0, 0};
        place_of(g, &boxes[bp->order.at[i]], &p);
        const uint64_t column = (uint64_t)((int64_t)p.column - columns.low + SPAN_MAX);
        const uint64_t row = (uint64_t)((int64_t)p.row - rows.low);
        bp->key.at[i] = (row << g->column_bits | column) << SPAN_BITS | (uint64_t)p.span;
    }
    return bits_of(rows.high - rows.low) + g->column_bits + SPAN_BITS;
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

/* Radix sort of the bits above the span, stable. */
static void sort_keys(carom_broadphase *bp, int m, int bits)
{
    for (int shift = SPAN_BITS; shift < bits; shift += DIGIT) {
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

/* Box i against those from index `from` up to the place `last`. */
static carom_status test_run(carom_broadphase *bp, int i, int from, uint64_t last, int m)
{
    const carom_box a = bp->sorted.at[i];
    int j = from;
    for (; j < m && bp->key.at[j] >> SPAN_BITS <= last; j++) {
        if (!crm_box_overlaps(&a, &bp->sorted.at[j])) continue;
        const carom_status e = crm_pair_add(bp, bp->order.at[i], bp->order.at[j]);
        if (e) return e;
    }
    bp->stats.n_tests += j - from;
    return CAROM_OK;
}

/* *done = 0: too crowded. */
static carom_status scan_rows(carom_broadphase *bp, const grid *g, int n, int m, int *done)
{
    const uint64_t row = (uint64_t)1 << g->column_bits;
    const long limit = (long)CROWDED * n;
    int first = 0;
    for (int i = 0; i < m && bp->stats.n_tests <= limit; i++) {
        const uint64_t at = bp->key.at[i] >> SPAN_BITS;
        const uint64_t last = at + (bp->key.at[i] & ((1 << SPAN_BITS) - 1));
        carom_status e = test_run(bp, i, i + 1, last, m);
        while (first < m && bp->key.at[first] >> SPAN_BITS < at + row - SPAN_MAX) first++;
        if (!e) e = test_run(bp, i, first, last + row, m);
        if (e) return e;
    }
    *done = bp->stats.n_tests <= limit;
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
    if (!choose_rows(n, boxes, &g)) return CAROM_OK;
    carom_status e = reserve(bp, n);
    if (e) return e;
    const int m = split(bp, &g, n, boxes, &columns, &rows);
    if (m < 0) return CAROM_OK;
    bp->stats.method = CAROM_GRID;
    *done = 1;
    if (m) {
        sort_keys(bp, m, make_keys(bp, &g, m, boxes, columns, rows));
        for (int i = 0; i < m; i++) bp->sorted.at[i] = boxes[bp->order.at[i]];
        e = scan_rows(bp, &g, n, m, done);
    }
    if (!e && *done) e = scan_large(bp, m, boxes);
    return e;
}
