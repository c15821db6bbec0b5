/* command.h: what a subcommand of `carom` is, and its parsed arguments. */
#ifndef CRM_COMMAND_H
#define CRM_COMMAND_H

/* Exit codes of carom. */
enum { CRM_DONE = 0, CRM_USAGE = 1, CRM_FAILED = 2 };

typedef enum crm_takes { CRM_TAKES_NOTHING, CRM_TAKES_VALUE, CRM_TAKES_OPTIONAL } crm_takes;

typedef struct crm_option {
    const char *name; /* "--dt" */
    crm_takes takes;  /* a value as "--dt 0.1" or "--dt=0.1"; an optional one only with "=" */
} crm_option;

struct crm_arguments;

typedef struct crm_command {
    const char *name;
    const char *synopsis;      /* what follows "carom " in the usage line */
    const char *purpose;       /* one line */
    const char *help;          /* options, one a line */
    const crm_option *options; /* name NULL at the end */
    int min_files;
    int max_files;
    int (*run)(const struct crm_arguments *arguments); /* exit code */
} crm_command;

typedef struct crm_given {
    const char *name;
    const char *value; /* NULL: given without */
} crm_given;

typedef struct crm_arguments {
    const crm_command *command;
    int n_files;
    const char **files;
    int n_given;
    crm_given *given; /* in the order of the command line */
} crm_arguments;

/* Parses what follows the name of the subcommand.  0, with a message on stderr, when it is wrong.
 * Free in any case. */
int crm_arguments_parse(const crm_command *command, int argc, char **argv, crm_arguments *out);
void crm_arguments_free(crm_arguments *arguments);

/* The last value given, NULL when the option was not given (or has no value). */
const char *crm_argument(const crm_arguments *arguments, const char *name);
int crm_argument_given(const crm_arguments *arguments, const char *name);
/* The option as a number, *value unchanged when it was not given.  0, with a message, when it is no
 * number in [low, high]. */
int crm_argument_number(const crm_arguments *arguments, const char *name, double low, double high,
                        double *value);

/* Message on stderr: "carom NAME: ..." as printf; returns CRM_USAGE. */
#ifdef __GNUC__
__attribute__((format(printf, 2, 3)))
#endif
int crm_usage_error(const crm_command *command, const char *format, ...);

#endif
