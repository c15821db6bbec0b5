/* json.h: JSON values that know their place, and the list of everything wrong with a file. */
#ifndef CRM_SCENE_JSON_H
#define CRM_SCENE_JSON_H

#include "carom/base.h"

#include <jansson.h>

/* What is wrong with one file: sentences "FILE: place: fault; remedy". */
typedef struct crm_problems {
    const char *file; /* view; named first in every sentence */
    int count;
    char **text;   /* count of them */
    int no_memory; /* memory ran out: what was read is not the whole file */
} crm_problems;

crm_problems crm_problems_of(const char *file);
void crm_problems_free(crm_problems *problems);
/* 1: something is wrong. */
int crm_faulty(const crm_problems *problems);

/* n elements, zeroed, at least one; realloc to n elements.  NULL: problems->no_memory is set, and
 * `old` is as it was. */
void *crm_make(crm_problems *problems, size_t n, size_t size);
void *crm_regrow(crm_problems *problems, void *old, size_t n, size_t size);

/* A value of the file.  json is NULL when the key is absent; up is the value that contains it. */
typedef struct crm_node {
    const json_t *json;
    const struct crm_node *up;
    const char *key; /* name in the object above; NULL: an item of an array or the root */
    int index;       /* in the array above */
} crm_node;

/* Notes a fault at a node (NULL: the file as a whole).  Format as printf. */
#ifdef __GNUC__
__attribute__((format(printf, 3, 4)))
#endif
void crm_fault(crm_problems *problems, const crm_node *at, const char *format, ...);

/* Writes the place, like "bodies[3].mass"; "" for the root.  Always terminated. */
void crm_node_place(const crm_node *node, char *text, size_t size);

/* The file's whole text, parsed; NULL with the fault noted.  "-" reads standard input.  Duplicate
 * keys are faults with their place; syntax errors carry line and column. */
json_t *crm_json_load(crm_problems *problems);
/* The same for files that Python wrote: NaN and Infinity, which JSON has not, read as "". */
json_t *crm_json_load_python(crm_problems *problems);

crm_node crm_root(const json_t *json);
/* The member of an object, the item of an array; json NULL when there is none. */
crm_node crm_member(const crm_node *object, const char *key);
crm_node crm_item(const crm_node *array, int index);
/* Items of an array, 0 when it is none. */
int crm_length(const crm_node *array);

/* Notes a fault for every member not in keys (NULL at the end); "_..." and "reference" are passed
 * over.  0, with a fault, when the node is no object. */
int crm_check_keys(crm_problems *problems, const crm_node *object, const char *const *keys);

/* Each stores the value and returns 1; absent: 0; of another kind: 0 with a fault noted. */
int crm_get_number(crm_problems *problems, const crm_node *node, double *value);
int crm_get_numbers(crm_problems *problems, const crm_node *node, int count, double *values);
int crm_get_integer(crm_problems *problems, const crm_node *node, double low, double high,
                    json_int_t *value);
int crm_get_flag(crm_problems *problems, const crm_node *node, int *value);
int crm_get_text(crm_problems *problems, const crm_node *node, const char **value); /* view */

/* Position in words of the n names (NULL-terminated); -1 with a fault that lists them. */
int crm_get_word(crm_problems *problems, const crm_node *node, const char *const *words);

#endif
