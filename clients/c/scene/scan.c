#include "scan.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

/* A key as written, without its quotes. */
typedef struct span {
    const char *text;
    int length;
} span;

/* One open object or array and the way to it. */
typedef struct level {
    crm_node node; /* json unused */
    int is_object;
    int first_key; /* its keys are keys[first_key ...] of the scanner */
    char *name;    /* owned copy of the key now read */
} level;

typedef struct scanner {
    const char *at;
    crm_problems *problems;
    level *levels;
    int depth;
    span *keys;
    int n_keys;
    int n_found;
} scanner;

static span read_string(scanner *s)
{
    const char *start = ++s->at;
    while (*s->at && *s->at != '"') s->at += s->at[0] == '\\' && s->at[1] ? 2 : 1;
    const span key = {start, (int)(s->at - start)};
    if (*s->at) s->at++;
    return key;
}

static void open_level(scanner *s, int is_object)
{
    level *levels = crm_regrow(s->problems, s->levels, (size_t)s->depth + 1, sizeof *levels);
    if (!levels) return;
    s->levels = levels;
    level *l = &s->levels[s->depth++];
    memset(l, 0, sizeof *l);
    l->is_object = is_object;
    l->first_key = s->n_keys;
}

static void report(scanner *s, span key)
{
    char name[64];
    const int n = key.length < 63 ? key.length : 63;
    memcpy(name, key.text, (size_t)n);
    name[n] = '\0';
    /* nodes[0] is the root; nodes[i + 1] the place now read in the i-th open value */
    crm_node *nodes = crm_make(s->problems, (size_t)s->depth + 1, sizeof *nodes);
    if (!nodes) return;
    nodes[0] = crm_root(NULL);
    for (int i = 0; i < s->depth; i++) {
        nodes[i + 1] = s->levels[i].node;
        nodes[i + 1].up = &nodes[i];
        nodes[i + 1].key = s->levels[i].is_object ? s->levels[i].name : NULL;
    }
    nodes[s->depth].key = name;
    crm_fault(s->problems, &nodes[s->depth], "the key stands twice; keep one of them");
    free(nodes);
    s->n_found++;
}

static int compare_keys(const void *a, const void *b)
{
    const span *x = a;
    const span *y = b;
    const int shorter = x->length < y->length ? x->length : y->length;
    const int order = memcmp(x->text, y->text, (size_t)shorter);
    return order ? order : x->length - y->length;
}

static void close_level(scanner *s)
{
    level *l = &s->levels[s->depth - 1];
    const int n = s->keys ? s->n_keys - l->first_key : 0;
    span *keys = s->keys ? s->keys + l->first_key : NULL;
    if (n > 1) qsort(keys, (size_t)n, sizeof *keys, compare_keys);
    for (int i = 1; i < n; i++) {
        if (compare_keys(&keys[i - 1], &keys[i]) == 0) report(s, keys[i]);
    }
    s->n_keys = l->first_key;
    free(l->name);
    s->depth--;
}

/* Key when a colon follows, value otherwise. */
static void take_string(scanner *s)
{
    const span text = read_string(s);
    while (isspace((unsigned char)*s->at)) s->at++;
    if (*s->at != ':' || !s->depth) return;
    level *l = &s->levels[s->depth - 1];
    span *keys = crm_regrow(s->problems, s->keys, (size_t)s->n_keys + 1, sizeof *keys);
    if (keys) s->keys = keys;
    char *name = crm_regrow(s->problems, l->name, (size_t)text.length + 1, 1);
    if (name) l->name = name;
    if (!keys || !name) return;
    s->keys[s->n_keys++] = text;
    memcpy(l->name, text.text, (size_t)text.length);
    l->name[text.length] = '\0';
}

int crm_scan_duplicates(const char *text, crm_problems *problems)
{
    scanner s;
    memset(&s, 0, sizeof s);
    s.at = text;
    s.problems = problems;
    while (*s.at && !problems->no_memory) {
        const char c = *s.at;
        if (c == '"') {
            take_string(&s);
            continue;
        }
        if (c == '{' || c == '[') open_level(&s, c == '{');
        if ((c == '}' || c == ']') && s.depth) close_level(&s);
        if (c == ',' && s.depth) s.levels[s.depth - 1].node.index++;
        s.at++;
    }
    while (s.depth) close_level(&s);
    free(s.levels);
    free(s.keys);
    return s.n_found;
}
