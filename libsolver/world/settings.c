#include "carom/world.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

carom_world_settings carom_world_defaults(void)
{
    carom_world_settings s;
#define DEFAULT(name, type, value, unit, text) s.name = value;
    CAROM_WORLD_SETTINGS(DEFAULT)
#undef DEFAULT
    s.gravity[0] = 0;
    s.gravity[1] = -9.81;
    return s;
}

typedef struct word {
    const char *setting;
    const char *text;
    int value;
} word;

static const word WORDS[] = {
    {"integrator", "located", CAROM_LOCATED},
    {"integrator", "euler", CAROM_EULER},
    {"integrator", "fixed", CAROM_FIXED},
    {"events", "stops", CAROM_EVENTS_STOPS},
    {"events", "all", CAROM_EVENTS_ALL},
    {"combine_friction", "mean", CAROM_COMBINE_MEAN},
    {"combine_friction", "geometric", CAROM_COMBINE_GEOMETRIC},
    {"combine_friction", "min", CAROM_COMBINE_MIN},
    {"combine_friction", "max", CAROM_COMBINE_MAX},
    {"combine_restitution", "mean", CAROM_COMBINE_MEAN},
    {"combine_restitution", "geometric", CAROM_COMBINE_GEOMETRIC},
    {"combine_restitution", "min", CAROM_COMBINE_MIN},
    {"combine_restitution", "max", CAROM_COMBINE_MAX},
};
enum { N_WORDS = sizeof WORDS / sizeof WORDS[0] };

/* A setting of words takes only its words; *is_word says whether it is one. */
static int find_word(const char *name, const char *value, int *is_word)
{
    *is_word = 0;
    for (int k = 0; k < N_WORDS; k++) {
        if (strcmp(WORDS[k].setting, name) != 0) continue;
        *is_word = 1;
        if (strcmp(WORDS[k].text, value) == 0) return k;
    }
    return -1;
}

static int is_number(const char *text, double *value)
{
    char *end = NULL;
    *value = strtod(text, &end);
    return end != text && *end == '\0' && isfinite(*value);
}

static carom_status refuse(const char **reason, const char *text)
{
    if (reason) *reason = text;
    return CAROM_E_ARGUMENT;
}

carom_status carom_world_settings_set(carom_world_settings *settings, const char *name,
                                      const char *value, const char **reason)
{
    if (reason) *reason = "";
    if (!settings || !name || !value) return CAROM_E_ARGUMENT;
    int is_word;
    const int k = find_word(name, value, &is_word);
    if (is_word && k < 0) return refuse(reason, "no such choice; see `carom help settings`");
    double number = k >= 0 ? WORDS[k].value : 0;
    if (!is_word && !is_number(value, &number)) return refuse(reason, "not a finite number");
#define SET(field, type, preset, unit, text)                                                       \
    if (strcmp(name, #field) == 0) {                                                               \
        if ((double)(type)number != number) return refuse(reason, "not a whole number");           \
        settings->field = (type)number;                                                            \
        return CAROM_OK;                                                                           \
    }
    CAROM_WORLD_SETTINGS(SET)
#undef SET
    return refuse(reason, "no such setting; see `carom help settings`");
}
