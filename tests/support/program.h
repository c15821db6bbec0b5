/* program.h: runs the program `carom` (CAROM_PROGRAM) from outside and looks at what it gives. */
#ifndef SUPPORT_PROGRAM_H
#define SUPPORT_PROGRAM_H

#include "near.h"

#include <jansson.h>

/* What one call of the program gave. */
typedef struct program_call {
    int code; /* exit code */
    char *out;
    char *err;
} program_call;

/* A folder of this process for all files below; set-up and tear-down of a cmocka group. */
int program_make_folder(void **state);
int program_remove_folder(void **state);
const char *program_folder(void);

/* A file of the folder; program_read gives NULL when there is none, else the caller frees. */
char *program_read(const char *name);
void program_write(const char *name, const char *text);

/* Runs "carom ARGUMENTS" in the folder; % in them is the folder of the test data. */
program_call program_run(const char *arguments);
void program_free(program_call *call);

/* Runs it and fails unless the exit code is 1, nothing is on standard output and the message on
 * standard error contains the text. */
void program_refuses(const char *arguments, const char *message);

/* Line k of JSON lines, parsed: a new reference; NULL past the end. */
json_t *program_line(const char *text, int k);
int program_count_lines(const char *text);

/* A number of an object, or number i of an array in it; fails when there is none. */
double program_number(const json_t *object, const char *key);
double program_entry(const json_t *object, const char *key, size_t i);

#endif
