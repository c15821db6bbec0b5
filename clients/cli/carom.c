/* carom: the command line.  docs/cli.md is its manual. */
#include "carom/world.h"
#include "clients/c/scene/remote.h"
#include "cmd.h"

#include <stdio.h>
#include <string.h>

static const crm_command *const commands[] = {
    &crm_command_run,     &crm_command_gradient, &crm_command_explain, &crm_command_validate,
    &crm_command_contact, &crm_command_lcp,      &crm_command_send,    &crm_command_watch};
enum { N_COMMANDS = sizeof commands / sizeof commands[0] };

static const crm_command *find_command(const char *name)
{
    for (int i = 0; i < N_COMMANDS; i++) {
        if (strcmp(commands[i]->name, name) == 0) return commands[i];
    }
    return NULL;
}

static void print_usage(FILE *f)
{
    fprintf(f, "carom %s: differentiable 2-D rigid bodies with hard contact\n\n", carom_version());
    for (int i = 0; i < N_COMMANDS; i++) {
        fprintf(f, "  carom %s\n      %s\n", commands[i]->synopsis, commands[i]->purpose);
    }
    fputs("  carom help [COMMAND | settings]\n      this text; options of a command; settings of a "
          "scene\n  carom --version\n\n"
          "Results go to standard output or --out, everything else to standard error.\n"
          "Exit code 0: done.  1: wrong usage or input.  2: the computation failed.\n",
          f);
}

static void print_setting(const char *name, double value, const char *unit, const char *text)
{
    char preset[32];
    crm_setting_text(name, value, text, preset, sizeof preset);
    double x = 0;
    if (sscanf(preset, "%lf", &x) == 1) snprintf(preset, sizeof preset, "%.6g", x);
    printf("  %-20s %-10s %-11s %s\n", name, preset, unit[0] ? unit : "-", text);
}

static void print_settings(void)
{
    printf("Settings of a scene, by name: in \"settings\" of the file, or --set NAME=VALUE.\n\n");
    printf("  %-20s %-10s %-11s %s\n", "name", "default", "unit", "meaning");
#define ROW(name, type, value, unit, text) print_setting(#name, (double)(value), unit, text);
    CAROM_WORLD_SETTINGS(ROW)
#undef ROW
}

static int help(int argc, char **argv)
{
    if (argc == 0) {
        print_usage(stdout);
        return CRM_DONE;
    }
    if (strcmp(argv[0], "settings") == 0) {
        print_settings();
        return CRM_DONE;
    }
    const crm_command *c = find_command(argv[0]);
    if (!c) {
        fprintf(stderr, "carom help: no command \"%s\"\n", argv[0]);
        return CRM_USAGE;
    }
    printf("usage: carom %s\n\n%s\n\n%s", c->synopsis, c->purpose, c->help);
    return CRM_DONE;
}

static int run_command(const crm_command *c, int argc, char **argv)
{
    if (argc > 0 && (strcmp(argv[0], "--help") == 0 || strcmp(argv[0], "-h") == 0)) {
        char *name[] = {(char *)c->name}; /* help only reads it */
        return help(1, name);
    }
    crm_arguments a;
    const int code = crm_arguments_parse(c, argc, argv, &a) ? c->run(&a) : CRM_USAGE;
    crm_arguments_free(&a);
    return code;
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        print_usage(stderr);
        return CRM_USAGE;
    }
    const char *name = argv[1];
    if (strcmp(name, "--version") == 0) {
        printf("carom %s\n", carom_version());
        return CRM_DONE;
    }
    if (strcmp(name, "help") == 0 || strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0) {
        return help(argc - 2, argv + 2);
    }
    const crm_command *c = find_command(name);
    if (c) return run_command(c, argc - 2, argv + 2);
    fprintf(stderr, "carom: no command \"%s\"; see carom help\n", name);
    return CRM_USAGE;
}
