#include "command.h"

#include "clients/c/scene/json.h"
#include "io/memory.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int crm_usage_error(const crm_command *command, const char *format, ...)
{
    fprintf(stderr, "carom %s: ", command->name);
    va_list list;
    va_start(list, format);
    vfprintf(stderr, format, list);
    va_end(list);
    fprintf(stderr, "\nusage: carom %s\n", command->synopsis);
    return CRM_USAGE;
}

static void add_given(crm_arguments *a, const char *name, const char *value)
{
    a->given = crm_resize(a->given, (size_t)a->n_given + 1, sizeof *a->given);
    a->given[a->n_given].name = name;
    a->given[a->n_given++].value = value;
}

/* The option that `text` names, up to an equals sign; NULL when the command has none such. */
static const crm_option *find_option(const crm_command *command, const char *text)
{
    const size_t n = strcspn(text, "=");
    for (const crm_option *o = command->options; o->name; o++) {
        if (strlen(o->name) == n && strncmp(o->name, text, n) == 0) return o;
    }
    return NULL;
}

/* Takes argv[i], and the next when it is the value: returns how many, 0 with a message. */
static int take_option(crm_arguments *a, int argc, char **argv, int i)
{
    const crm_option *o = find_option(a->command, argv[i]);
    const char *equals = strchr(argv[i], '=');
    if (!o) {
        crm_usage_error(a->command, "unknown option %s", argv[i]);
        return 0;
    }
    if (o->takes == CRM_TAKES_NOTHING && equals) {
        crm_usage_error(a->command, "%s takes no value", o->name);
        return 0;
    }
    if (equals || o->takes != CRM_TAKES_VALUE) {
        add_given(a, o->name, equals ? equals + 1 : NULL);
        return 1;
    }
    if (i + 1 >= argc) {
        crm_usage_error(a->command, "%s needs a value", o->name);
        return 0;
    }
    add_given(a, o->name, argv[i + 1]);
    return 2;
}

int crm_arguments_parse(const crm_command *command, int argc, char **argv, crm_arguments *out)
{
    memset(out, 0, sizeof *out);
    out->command = command;
    int only_files = 0;
    for (int i = 0; i < argc;) {
        if (!only_files && strcmp(argv[i], "--") == 0) {
            only_files = 1;
            i++;
        } else if (!only_files && argv[i][0] == '-' && argv[i][1]) {
            const int taken = take_option(out, argc, argv, i);
            if (!taken) return 0;
            i += taken;
        } else {
            out->files = crm_resize(out->files, (size_t)out->n_files + 1, sizeof *out->files);
            out->files[out->n_files++] = argv[i++];
        }
    }
    if (out->n_files < command->min_files) {
        crm_usage_error(command, "needs a file");
        return 0;
    }
    if (out->n_files > command->max_files) {
        crm_usage_error(command, "one argument too many: %s", out->files[command->max_files]);
        return 0;
    }
    return 1;
}

void crm_arguments_free(crm_arguments *arguments)
{
    free(arguments->files);
    free(arguments->given);
}

const char *crm_argument(const crm_arguments *arguments, const char *name)
{
    const char *value = NULL;
    for (int i = 0; i < arguments->n_given; i++) {
        if (strcmp(arguments->given[i].name, name) == 0) value = arguments->given[i].value;
    }
    return value;
}

int crm_argument_given(const crm_arguments *arguments, const char *name)
{
    for (int i = 0; i < arguments->n_given; i++) {
        if (strcmp(arguments->given[i].name, name) == 0) return 1;
    }
    return 0;
}

int crm_argument_number(const crm_arguments *arguments, const char *name, double low, double high,
                        double *value)
{
    const char *text = crm_argument(arguments, name);
    if (!text) return 1;
    char *end = NULL;
    const double x = strtod(text, &end);
    if (end == text || *end || !(x >= low && x <= high)) {
        crm_usage_error(arguments->command, "%s: \"%s\" is not a number from %g to %g", name, text,
                        low, high);
        return 0;
    }
    *value = x;
    return 1;
}
