/* hull.c: convex hull of points, by index, in place: the points below the line from the leftmost to
 * the rightmost one are sorted to the right, those above to the left (Andrew's chains). */
#include "carom/shape.h"

#include "vec.h"

/* A vertex lower over the line of its neighbors is left out [1], times the extent [m]: four times
 * what carom_shape_check asks for, so that areas pass too. */
static const double HULL_TOL = 4e-12;

/* The limits of carom_shape_check. */
static const double SIZE_MAX_M = 1e40;
static const double SIZE_MIN_M = 1e-40;

static int is_before(const carom_vec2 *p, int i, int j)
{
    if (p[i].x != p[j].x) return p[i].x < p[j].x;
    if (p[i].y != p[j].y) return p[i].y < p[j].y;
    return i < j;
}

static void sift_down(const carom_vec2 *p, int *heap, int root, int n)
{
    for (int child = 2 * root + 1; child < n; child = 2 * root + 1) {
        if (child + 1 < n && is_before(p, heap[child], heap[child + 1])) child++;
        if (!is_before(p, heap[root], heap[child])) return;
        const int held = heap[root];
        heap[root] = heap[child];
        heap[child] = held;
        root = child;
    }
}

/* Left to right. */
static void heap_sort(const carom_vec2 *p, int *index, int n)
{
    for (int root = n / 2 - 1; root >= 0; root--) sift_down(p, index, root, n);
    for (int last = n - 1; last > 0; last--) {
        const int held = index[0];
        index[0] = index[last];
        index[last] = held;
        sift_down(p, index, 0, last);
    }
}

static void reverse(int *index, int n)
{
    for (int i = 0, j = n - 1; i < j; i++, j--) {
        const int held = index[i];
        index[i] = index[j];
        index[j] = held;
    }
}

/* b is not to the right of a -> c: no vertex of a counterclockwise hull. */
static int is_inside(const carom_vec2 *p, int a, int b, int c)
{
    return crm_cross(crm_sub(p[b], p[a]), crm_sub(p[c], p[a])) <= 0;
}

/* b is between its neighbors and not more than tol over the line through them. */
static int is_flat(const carom_vec2 *p, int a, int b, int c, double tol)
{
    const carom_vec2 base = crm_sub(p[c], p[a]);
    const carom_vec2 x = crm_sub(p[b], p[a]);
    const double along = crm_dot(x, base);
    return crm_cross(x, base) <= tol * crm_length(base) && along >= 0 &&
           along <= crm_dot(base, base);
}

/* Drops the inside ones of index[n], an outline in order; index[0] stays.  Returns the number left.
 */
static int chain(const carom_vec2 *p, int *index, int n)
{
    int m = 1;
    for (int k = 1; k < n; k++) {
        while (m > 1 && is_inside(p, index[m - 2], index[m - 1], index[k])) m--;
        index[m++] = index[k];
    }
    while (m > 2 && is_inside(p, index[m - 2], index[m - 1], index[0])) m--;
    return m;
}

/* The convex outline without the vertices that are flat within tol. */
static int thin_out(const carom_vec2 *p, int *index, int n, double tol)
{
    int before;
    do {
        before = n;
        int m = 0;
        for (int k = 0; k < before; k++) {
            const int a = index[m ? m - 1 : before - 1];
            const int c = index[k + 1 < before ? k + 1 : 0];
            if (n > 2 && is_flat(p, a, index[k], c, tol)) {
                n--;
            } else {
                index[m++] = index[k];
            }
        }
    } while (n < before && n > 2);
    return n;
}

static double extent_of(int n, const carom_vec2 *p)
{
    carom_vec2 low = p[0];
    carom_vec2 high = p[0];
    for (int i = 1; i < n; i++) {
        low = crm_vec(fmin(low.x, p[i].x), fmin(low.y, p[i].y));
        high = crm_vec(fmax(high.x, p[i].x), fmax(high.y, p[i].y));
    }
    return fmax(high.x - low.x, high.y - low.y);
}

/* index <- leftmost, the points below, rightmost, the points above; returns the number below. */
static int partition(int n, const carom_vec2 *p, int left, int right, int *index, int *n_above)
{
    const carom_vec2 base = crm_sub(p[right], p[left]);
    int below = 0;
    int above = 0;
    index[0] = left;
    for (int i = 0; i < n; i++) {
        const double side = crm_cross(base, crm_sub(p[i], p[left]));
        if (i == left || i == right || side == 0) continue;
        if (side < 0) {
            index[1 + below++] = i;
        } else {
            index[n - ++above] = i;
        }
    }
    index[1 + below] = right;
    for (int k = 0; k < above; k++) index[2 + below + k] = index[n - above + k];
    *n_above = above;
    return below;
}

carom_status carom_hull_from_points(int n, const carom_vec2 *points, int *index, int *count)
{
    if (n < 1 || !points || !index || !count) return CAROM_E_ARGUMENT;
    int left = 0;
    int right = 0;
    for (int i = 0; i < n; i++) {
        if (!(fabs(points[i].x) <= SIZE_MAX_M && fabs(points[i].y) <= SIZE_MAX_M)) {
            return CAROM_E_ARGUMENT;
        }
        if (is_before(points, i, left)) left = i;
        if (is_before(points, right, i)) right = i;
    }
    const double extent = extent_of(n, points);
    if (!(extent >= SIZE_MIN_M)) {
        index[0] = 0;
        *count = 1;
        return CAROM_OK;
    }
    int above;
    const int below = partition(n, points, left, right, index, &above);
    heap_sort(points, index + 1, below);
    heap_sort(points, index + 2 + below, above);
    reverse(index + 2 + below, above);
    const int m = chain(points, index, 2 + below + above);
    *count = thin_out(points, index, m, HULL_TOL * extent);
    return CAROM_OK;
}
