#include "gradient/loss.h"
#include "io/memory.h"

#include <stdlib.h>
#include <string.h>

/* Component k: coordinate k % 3 of q (k < 3) or of v. */
static const char *const component_words[] = {"angle", "x", "y", "omega", "vx", "vy", NULL};

static int find_body(crm_problems *problems, const crm_node *node, const crm_scene *scene)
{
    json_int_t index = 0;
    if (json_is_string(node->json)) {
        for (int i = 0; i < scene->n_bodies; i++) {
            const char *name = scene->bodies[i].name;
            if (name && strcmp(name, json_string_value(node->json)) == 0) return i;
        }
        crm_fault(problems, node, "no body of the scene has this name");
        return 0;
    }
    if (!node->json) crm_fault(problems, node, "must be given: index or name of a body");
    crm_get_integer(problems, node, 0, scene->n_bodies - 1, &index);
    return (int)index;
}

static long read_step(crm_problems *problems, const crm_node *node, long n_steps)
{
    json_int_t step = n_steps;
    if (json_is_string(node->json)) {
        if (strcmp(json_string_value(node->json), "final") != 0) {
            crm_fault(problems, node, "must be \"final\" or a step");
        }
        return n_steps;
    }
    crm_get_integer(problems, node, 0, (double)n_steps, &step);
    return (long)step;
}

static void read_term(crm_problems *problems, const crm_node *node, const crm_scene *scene,
                      long n_steps, crm_term *term)
{
    static const char *const keys[] = {"step", "body", "component", "weight", "target", NULL};
    term->weight = 1;
    if (!crm_check_keys(problems, node, keys)) return;
    const crm_node step = crm_member(node, "step");
    const crm_node body = crm_member(node, "body");
    const crm_node component = crm_member(node, "component");
    const crm_node weight = crm_member(node, "weight");
    const crm_node target = crm_member(node, "target");
    term->step = read_step(problems, &step, n_steps);
    const int i = find_body(problems, &body, scene);
    if (!component.json)
        crm_fault(problems, &component, "must be given: angle, x, y, omega, vx, vy");
    const int k = component.json ? crm_get_word(problems, &component, component_words) : -1;
    term->of_velocity = k >= 3;
    term->coordinate = 3 * i + (k >= 0 ? k % 3 : 0);
    crm_get_number(problems, &weight, &term->weight);
    term->squared = crm_get_number(problems, &target, &term->target);
}

/* By step, then by coordinate: sums run in one order. */
static int compare_steps(const void *a, const void *b)
{
    const crm_term *x = a;
    const crm_term *y = b;
    if (x->step != y->step) return x->step < y->step ? -1 : 1;
    return x->coordinate - y->coordinate;
}

int crm_loss_read(crm_problems *problems, const crm_scene *scene, long n_steps, crm_loss *loss)
{
    static const char *const keys[] = {"terms", NULL};
    memset(loss, 0, sizeof *loss);
    json_t *json = crm_json_load(problems);
    const crm_node root = crm_root(json);
    if (!json || !crm_check_keys(problems, &root, keys)) {
        json_decref(json);
        return 0;
    }
    const crm_node terms = crm_member(&root, "terms");
    const int n = crm_length(&terms);
    if (!json_is_array(terms.json)) crm_fault(problems, &terms, "must be an array of terms");
    loss->terms = crm_resize(NULL, (size_t)n, sizeof *loss->terms);
    memset(loss->terms, 0, (size_t)n * sizeof *loss->terms);
    loss->count = n;
    for (int i = 0; i < n; i++) {
        const crm_node item = crm_item(&terms, i);
        read_term(problems, &item, scene, n_steps, &loss->terms[i]);
    }
    qsort(loss->terms, (size_t)n, sizeof *loss->terms, compare_steps);
    json_decref(json);
    return !crm_faulty(problems);
}

void crm_loss_free(crm_loss *loss)
{
    free(loss->terms);
    memset(loss, 0, sizeof *loss);
}

static double term_value(const crm_term *t, const double *q, const double *v)
{
    const double x = (t->of_velocity ? v : q)[t->coordinate];
    const double d = x - t->target;
    return t->squared ? t->weight * d * d : t->weight * x;
}

double crm_loss_at(const crm_loss *loss, long step, const double *q, const double *v)
{
    double sum = 0;
    for (int i = 0; i < loss->count; i++) {
        if (loss->terms[i].step == step) sum += term_value(&loss->terms[i], q, v);
    }
    return sum;
}

/* d term / d value, added to the right place of one state's cotangent. */
static void add_cotangent(const crm_term *t, const double *q, const double *v, double *q_bar,
                          double *v_bar)
{
    const double x = (t->of_velocity ? v : q)[t->coordinate];
    const double slope = t->squared ? 2 * t->weight * (x - t->target) : t->weight;
    (t->of_velocity ? v_bar : q_bar)[t->coordinate] += slope;
}

crm_loss_bars crm_loss_cotangents(const crm_loss *loss, const carom_tape *tape, int n_bodies)
{
    crm_loss_bars out = {0, NULL, NULL};
    const size_t n = 3 * (size_t)n_bodies;
    const size_t n_numbers = 2 * n * (size_t)loss->count;
    out.bars = crm_resize(NULL, (size_t)loss->count, sizeof *out.bars);
    out.numbers = crm_resize(NULL, n_numbers, sizeof *out.numbers);
    memset(out.numbers, 0, n_numbers * sizeof *out.numbers);
    for (int i = 0; i < loss->count; i++) {
        const crm_term *t = &loss->terms[i];
        const int step = (int)t->step;
        if (out.count == 0 || out.bars[out.count - 1].step != step) {
            out.bars[out.count].step = step;
            out.bars[out.count].q = out.numbers + 2 * n * (size_t)out.count;
            out.bars[out.count].v = out.bars[out.count].q + n;
            out.count++;
        }
        double *bar = out.numbers + 2 * n * (size_t)(out.count - 1);
        add_cotangent(t, carom_tape_q(tape, step), carom_tape_v(tape, step), bar, bar + n);
    }
    return out;
}

void crm_loss_bars_free(crm_loss_bars *bars)
{
    free(bars->bars);
    free(bars->numbers);
    memset(bars, 0, sizeof *bars);
}
