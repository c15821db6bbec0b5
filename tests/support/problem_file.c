#define _POSIX_C_SOURCE 200809L
#include "problem_file.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* First character of the value of "key" at or after `text`; NULL when absent. */
static const char *value_of(const char *text, const char *key)
{
    char quoted[64];
    snprintf(quoted, sizeof quoted, "\"%s\":", key);
    const char *at = text ? strstr(text, quoted) : NULL;
    return at ? at + strlen(quoted) : NULL;
}

static int read_int(const char *text, const char *key)
{
    const char *at = value_of(text, key);
    return at ? (int)strtol(at, NULL, 10) : -1;
}

static void read_string(const char *text, const char *key, char *out, size_t size)
{
    const char *at = value_of(text, key);
    size_t n = 0;
    out[0] = '\0';
    if (!at || *at != '"') return;
    for (at++; at[n] && at[n] != '"' && n + 1 < size; n++) out[n] = at[n];
    out[n] = '\0';
}

/* The numbers of an array, NULL when it is absent; *n: how many. */
static double *read_reals(const char *text, const char *key, int *n)
{
    const char *at = value_of(text, key);
    *n = -1;
    if (!at || *at != '[') return NULL;
    const char *end = strchr(at, ']');
    double *x = malloc(((size_t)(end - at) + 1) * sizeof *x);
    if (!x) return NULL;
    for (*n = 0, at++; at < end; (*n)++) {
        char *next;
        x[*n] = strtod(at, &next);
        if (next == at) break;
        at = *next == ',' ? next + 1 : next;
    }
    return x;
}

static int *read_ints(const char *text, const char *key, int *n)
{
    double *x = read_reals(text, key, n);
    int *k = x ? malloc(((size_t)*n + 1) * sizeof *k) : NULL;
    for (int i = 0; k && i < *n; i++) k[i] = (int)x[i];
    free(x);
    return k;
}

/* 0 when the three lists have one length and stay inside the matrix. */
static int read_triplets(const char *text, const char *key, problem_triplets *t)
{
    const char *at = value_of(text, key);
    int n_j;
    int n_x;
    t->n_rows = read_int(at, "rows");
    t->n_cols = read_int(at, "cols");
    t->i = read_ints(at, "i", &t->n);
    t->j = read_ints(at, "j", &n_j);
    t->x = read_reals(at, "x", &n_x);
    if (!t->i || !t->j || !t->x || n_j != t->n || n_x != t->n) return -1;
    for (int k = 0; k < t->n; k++)
        if (t->i[k] < 0 || t->i[k] >= t->n_rows || t->j[k] < 0 || t->j[k] >= t->n_cols) return -1;
    return 0;
}

static int parse(const char *text, problem_file *p)
{
    char status[32];
    int n[5];
    read_string(text, "name", p->name, sizeof p->name);
    read_string(text, "family", p->family, sizeof p->family);
    read_string(text, "status", status, sizeof status);
    p->feasible = strcmp(status, "ok") == 0;
    const char *at = value_of(text, "compare_v");
    p->compare_v = at && strncmp(at, "true", 4) == 0;
    at = value_of(text, "spread");
    p->spread = at ? strtod(at, NULL) : 0.0;
    p->n_bodies = read_int(text, "bodies");
    p->M = read_reals(text, "M", &n[0]);
    p->mu = read_reals(text, "mu", &n[1]);
    p->c = read_reals(text, "c", &n[2]);
    p->q = read_reals(text, "q", &n[3]);
    p->v = read_reals(text, "v", &n[4]);
    if (read_triplets(text, "J_c", &p->jc) || read_triplets(text, "J_t", &p->jt) ||
        read_triplets(text, "J_e", &p->je))
        return -1;
    p->n_contacts = n[1];
    p->n_joint_rows = p->je.n_rows;
    const int nv = 3 * p->n_bodies;
    const int has_v = n[4] == nv || (!p->feasible && n[4] <= 0);
    return n[0] == nv && n[3] == nv && has_v && n[2] == n[1] && p->jc.n_rows == n[1] &&
                   p->jt.n_rows == n[1] && p->jc.n_cols == nv
               ? 0
               : -1;
}

static char *slurp(const char *path)
{
    FILE *f = fopen(path, "rb");
    if (!f) return NULL;
    char *text = NULL;
    if (fseek(f, 0, SEEK_END) == 0) {
        const long size = ftell(f);
        rewind(f);
        text = size >= 0 ? malloc((size_t)size + 1) : NULL;
        if (text) text[fread(text, 1, (size_t)size, f)] = '\0';
    }
    fclose(f);
    return text;
}

int problem_file_read(const char *path, problem_file *p)
{
    memset(p, 0, sizeof *p);
    char *text = slurp(path);
    const int status = text ? parse(text, p) : -1;
    free(text);
    if (status) problem_file_free(p);
    return status;
}

static void free_triplets(problem_triplets *t)
{
    free(t->i);
    free(t->j);
    free(t->x);
}

void problem_file_free(problem_file *p)
{
    free(p->M);
    free(p->q);
    free(p->mu);
    free(p->c);
    free(p->v);
    free_triplets(&p->jc);
    free_triplets(&p->jt);
    free_triplets(&p->je);
    memset(p, 0, sizeof *p);
}

static int is_json(const struct dirent *e)
{
    const size_t n = strlen(e->d_name);
    return n > 5 && strcmp(e->d_name + n - 5, ".json") == 0;
}

int problem_file_each(const char *folder, void (*visit)(const problem_file *p, void *user),
                      void *user)
{
    struct dirent **list;
    const int n = scandir(folder, &list, is_json, alphasort);
    int read = 0;
    for (int k = 0; k < n; k++) {
        char path[1024];
        problem_file p;
        snprintf(path, sizeof path, "%s/%s", folder, list[k]->d_name);
        if (read >= 0 && problem_file_read(path, &p) == 0) {
            visit(&p, user);
            problem_file_free(&p);
            read++;
        } else {
            read = -1;
        }
        free(list[k]);
    }
    if (n >= 0) free(list);
    return n < 0 ? -1 : read;
}
