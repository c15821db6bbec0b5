/* jacobian.c: the dense derivative of one step, by columns or by rows. */
#include "grad/internal.h"

/* A column shares its factors with all others of a batch, a row has its own. */
enum { ROW_COST = 2, BATCH = 64 };

typedef struct jacobian {
    carom_tape *tape;
    const carom_gradient *rows;
    int step;
    size_t n_rows;    /* 6 n_bodies */
    size_t n_columns; /* of all arrays asked for */
    size_t widest;    /* ... of one of them */
    carom_gradient_stats stats;
} jacobian;

/* Numbers in one row of array k. */
static size_t width(const jacobian *j, int k)
{
    return crm_array(j->rows, k) ? crm_array_size(j->tape->world, 1, k) : 0;
}

static void add_stats(carom_gradient_stats *to, const carom_gradient_stats *from)
{
    to->degenerate = from->degenerate; /* the same of each pass */
    to->first_degenerate_step = from->first_degenerate_step;
    to->solves += from->solves;
}

/* The gradients of the components of the state, each into its row. */
static carom_status by_rows(jacobian *j)
{
    const size_t n3 = j->n_rows / 2;
    crm_memory *m = &j->tape->memory;
    double *seed = crm_new(m, j->n_rows, sizeof *seed);
    carom_status e = seed ? CAROM_OK : CAROM_E_MEMORY;
    const carom_state_bar bar = {j->step + 1, seed, seed + n3};
    for (size_t row = 0; e >= 0 && row < j->n_rows; row++) {
        carom_gradient g = {0};
        carom_gradient_stats stats;
        for (int k = 0; k < CRM_N_ARRAYS; k++) {
            double *p = crm_array(j->rows, k);
            if (p) crm_set_array(&g, k, p + row * width(j, k));
        }
        seed[row] = 1;
        e = crm_gradient_span(j->tape, j->step, j->step + 1, 1, &bar, &g, &stats);
        seed[row] = 0;
        if (e >= 0) add_stats(&j->stats, &stats);
    }
    crm_free(m, seed, j->n_rows, sizeof *seed);
    return e;
}

/* Where column `column` of all is: its array, and its place there. */
static int find_column(const jacobian *j, size_t column, size_t *place)
{
    int k = 0;
    for (; column >= width(j, k); k++) column -= width(j, k);
    *place = column;
    return k;
}

/* Directions first .. first + n - 1.  one: widest - 1 zeros, a 1, and as many zeros again, in which
 * every unit vector can be found. */
static void set_directions(const jacobian *j, size_t first, size_t n, double *one,
                           carom_gradient *directions)
{
    memset(directions, 0, n * sizeof *directions);
    for (size_t i = 0; i < n; i++) {
        size_t place;
        const int k = find_column(j, first + i, &place);
        crm_set_array(&directions[i], k, one + (j->widest - 1 - place));
    }
}

static carom_status run_batch(jacobian *j, size_t first, size_t n, double *one, double *column)
{
    carom_gradient directions[BATCH];
    const size_t n3 = j->n_rows / 2;
    const carom_state_dot dot = {j->step + 1, column, column + n3};
    crm_forward f;
    set_directions(j, first, n, one, directions);
    carom_status e = crm_forward_open(&f, j->tape, (int)n, directions, j->step);
    if (e >= 0) e = crm_forward_frame(&f, j->step);
    for (size_t i = 0; e >= 0 && i < n; i++) {
        size_t place;
        const int k = find_column(j, first + i, &place);
        double *to = crm_array(j->rows, k) + place;
        crm_give_state(&f, &f.lines[i], &dot);
        for (size_t row = 0; row < j->n_rows; row++) to[row * width(j, k)] = column[row];
    }
    if (e >= 0) add_stats(&j->stats, &f.stats);
    crm_forward_close(&f);
    return e;
}

static carom_status by_columns(jacobian *j)
{
    crm_memory *m = &j->tape->memory;
    const size_t n = 2 * j->widest + j->n_rows;
    double *one = crm_new(m, n, sizeof *one);
    if (!one) return CAROM_E_MEMORY;
    if (j->widest > 0) one[j->widest - 1] = 1;
    carom_status e = CAROM_OK;
    for (size_t at = 0; e >= 0 && at < j->n_columns; at += BATCH) {
        const size_t left = j->n_columns - at;
        e = run_batch(j, at, left < BATCH ? left : BATCH, one, one + 2 * j->widest);
    }
    crm_free(m, one, n, sizeof *one);
    return e;
}

carom_status carom_tape_jacobian(carom_tape *tape, int step, const carom_gradient *rows,
                                 carom_gradient_stats *stats)
{
    if (!tape || !rows) return CAROM_E_ARGUMENT;
    if (step < 0 || step >= tape->n_frames) {
        return crm_world_fail(tape->world, CAROM_E_ARGUMENT,
                              "derivative of step %d, but the tape has %d steps, from 0", step,
                              tape->n_frames);
    }
    carom_status e = crm_tape_current(tape);
    tape->ascending = 0;
    if (e >= 0) e = crm_hold_segment(tape, step);
    jacobian j = {tape, rows, step, 6 * (size_t)tape->n_bodies, 0, 0, {0}};
    j.stats.first_degenerate_step = -1;
    for (int k = 0; k < CRM_N_ARRAYS; k++) {
        j.n_columns += width(&j, k);
        if (width(&j, k) > j.widest) j.widest = width(&j, k);
    }
    if (e >= 0) e = j.n_columns <= ROW_COST * j.n_rows ? by_columns(&j) : by_rows(&j);
    if (e < 0) return crm_world_fail(tape->world, e, "derivative: %s", carom_status_text(e));
    if (stats) *stats = j.stats;
    return CAROM_OK;
}
