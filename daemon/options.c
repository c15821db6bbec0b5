#include "options.h"

#include <errno.h>
#include <limits.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const DEFAULT_HUB = "127.0.0.1:7700";

typedef struct option {
    const char *name; /* underscores stand for hyphens */
    const char *unit;
    const char *help;
    int value; /* default */
    int least;
    size_t offset; /* of the int in crm_options */
} option;

#define WIRE_OFFSET(name)   offsetof(crm_options, daemon.server.limits.name)
#define SERVER_OFFSET(name) offsetof(crm_options, daemon.server.name)

static const option numbers[] = {
    {"workers", "", "threads that compute", 2, 1, SERVER_OFFSET(n_workers)},
#define WIRE_OPTION(name, value, text) {"max_" #name, "", text, value, 0, WIRE_OFFSET(name)},
    CRM_WIRE_LIMITS(WIRE_OPTION)
#undef WIRE_OPTION
#define SERVER_OPTION(name, value, unit, text) {#name, unit, text, value, 0, SERVER_OFFSET(name)},
        CRM_SERVER_LIMITS(SERVER_OPTION)
#undef SERVER_OPTION
            {"max_clients", "", "connections of the hub", 256, 1,
             offsetof(crm_options, daemon.max_clients)},
    {"max_queue", "MB", "waiting for a subscriber; then states are dropped", 32, 1,
     offsetof(crm_options, daemon.max_queue)},
};

enum { N_NUMBERS = sizeof numbers / sizeof numbers[0] };

static int *number_of(crm_options *o, const option *n)
{
    return (int *)(void *)((char *)o + n->offset);
}

/* "--max-bodies" names "max_bodies". */
static int names(const char *argument, const char *name)
{
    if (strncmp(argument, "--", 2) != 0) return 0;
    const char *a = argument + 2;
    while (*a && (*a == *name || (*a == '-' && *name == '_'))) {
        a++;
        name++;
    }
    return !*a && !*name;
}

static int parse_number(const option *n, const char *argument, const char *value, int *to,
                        char *text)
{
    char *end = NULL;
    errno = 0;
    const long x = strtol(value, &end, 10);
    if (end == value || *end || errno || x < n->least || x > INT_MAX) {
        snprintf(text, CRM_DAEMON_TEXT, "%s %.100s: a whole number of at least %d is needed",
                 argument, value, n->least);
        return 0;
    }
    *to = (int)x;
    return 1;
}

static int parse_name(const char *value, char *text)
{
    const char *letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";
    const size_t n = strlen(value);
    if (n >= 1 && n <= 32 && strspn(value, letters) == n) return 1;
    snprintf(text, CRM_DAEMON_TEXT, "--name %.100s: 1 to 32 letters, digits, '_' or '-'", value);
    return 0;
}

static int parse_one(crm_options *o, const char *name, const char *value, char *text)
{
    if (strcmp(name, "--hub") == 0) {
        o->daemon.hub = value;
        return 1;
    }
    if (strcmp(name, "--lcm-url") == 0) {
        o->daemon.lcm_url = value;
        return 1;
    }
    if (strcmp(name, "--name") == 0) {
        o->daemon.server.name = value;
        return parse_name(value, text);
    }
    for (int i = 0; i < N_NUMBERS; i++) {
        if (names(name, numbers[i].name)) {
            return parse_number(&numbers[i], name, value, number_of(o, &numbers[i]), text);
        }
    }
    snprintf(text, CRM_DAEMON_TEXT, "unknown option '%.100s'; see caromd --help", name);
    return 0;
}

/* A message holds at least its header, and sizes in MB become bytes. */
static int check(const crm_options *o, char *text)
{
    if (o->daemon.server.limits.message < 1024) {
        snprintf(text, CRM_DAEMON_TEXT, "--max-message: at least 1024 bytes");
        return 0;
    }
    if (o->daemon.server.max_answer > INT_MAX >> 20) {
        snprintf(text, CRM_DAEMON_TEXT, "--max-answer: at most %d MB", INT_MAX >> 20);
        return 0;
    }
    return 1;
}

int crm_options_parse(int argc, char **argv, crm_options *o, char *text)
{
    memset(o, 0, sizeof *o);
    o->daemon.server = crm_server_defaults();
    for (int i = 0; i < N_NUMBERS; i++) *number_of(o, &numbers[i]) = numbers[i].value;
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0) {
            o->help = 1;
        } else if (strcmp(argv[i], "--version") == 0) {
            o->version = 1;
        } else if (i + 1 == argc) {
            snprintf(text, CRM_DAEMON_TEXT, "'%.100s' has no value, or is no option of caromd",
                     argv[i]);
            return 0;
        } else {
            if (!parse_one(o, argv[i], argv[i + 1], text)) return 0;
            i++;
        }
    }
    if (!o->daemon.hub && !o->daemon.lcm_url) o->daemon.hub = DEFAULT_HUB;
    return check(o, text);
}

static const char *const HEAD =
    "usage: caromd [options]\n"
    "\n"
    "Steps 2-D rigid bodies, and differentiates the steps, for clients on an LCM network.\n"
    "When it serves it prints one line, 'ready URL'; everything else goes to stderr.\n"
    "Ends on SIGTERM or SIGINT with status 0.\n"
    "\n"
    "  --hub ADDRESS:PORT        LCM hub over TCP (default 127.0.0.1:7700; port 0: a free one)\n"
    "  --lcm-url URL             an LCM network, like udpm://239.255.76.67:7667?ttl=0; then\n"
    "                            there is no hub unless --hub is given\n"
    "  --name NAME               suffix of all channels: CAROM_STATE_NAME ...\n"
    "  --help, --version\n"
    "\n"
    "limits:\n";

char *crm_options_help(void)
{
    const size_t size = strlen(HEAD) + 160 * (size_t)N_NUMBERS;
    char *help = malloc(size);
    if (!help) return NULL;
    size_t at = (size_t)snprintf(help, size, "%s", HEAD);
    for (int i = 0; i < N_NUMBERS; i++) {
        const option *n = &numbers[i];
        char name[32];
        snprintf(name, sizeof name, "%s N", n->name);
        for (char *c = name; *c; c++) {
            if (*c == '_') *c = '-';
        }
        at += (size_t)snprintf(help + at, size - at, "  --%-22s  %.80s (default %d%s%s)\n", name,
                               n->help, n->value, n->unit[0] ? " " : "", n->unit);
    }
    return help;
}
