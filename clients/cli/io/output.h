/* output.h: results as JSON, to standard output or a file. */
#ifndef CRM_OUTPUT_H
#define CRM_OUTPUT_H

#include <stdio.h>

typedef struct crm_output {
    FILE *file;
    const char *name; /* for messages */
} crm_output;

/* path NULL or "-": standard output.  0, with a message on stderr, when it cannot be opened. */
int crm_output_open(crm_output *out, const char *path);
/* Flushes and closes.  0, with a message, when anything could not be written. */
int crm_output_close(crm_output *out);

/* The shortest decimal of 15, 16 or 17 digits that reads back as the same double; null for NaN and
 * infinity, which JSON has not. */
void crm_put_number(crm_output *out, double x);
/* [a, b, ...] */
void crm_put_numbers(crm_output *out, int n, const double *x);
/* A JSON text with its quotes; NULL writes "". */
void crm_put_text(crm_output *out, const char *text);
/* "key": , preceded by a comma unless it is the first of its object. */
void crm_put_key(crm_output *out, int first, const char *key);
/* "key": number, preceded by a comma unless it is the first of its object. */
void crm_put_field(crm_output *out, int first, const char *key, double x);
void crm_put_raw(crm_output *out, const char *json);

#endif
