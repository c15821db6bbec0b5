/* load.h: a scene file with the changes of the command line, ready to run. */
#ifndef CRM_LOAD_H
#define CRM_LOAD_H

#include "clients/c/scene/scene.h"
#include "command.h"

/* Options that crm_load understands: put into a command's table. */
#define CRM_LOAD_OPTIONS                                                                           \
    {"--dt", CRM_TAKES_VALUE}, {"--duration", CRM_TAKES_VALUE}, {"--integrator", CRM_TAKES_VALUE}, \
        {"--set", CRM_TAKES_VALUE},                                                                \
    {                                                                                              \
        "--quiet", CRM_TAKES_NOTHING                                                               \
    }
#define CRM_LOAD_HELP                                                                              \
    "  --dt H             length of a step [s]\n"                                                  \
    "  --duration T       simulated time [s]\n"                                                    \
    "  --integrator NAME  euler, located or fixed\n"                                               \
    "  --set KEY=VALUE    a setting by name, like margin=1e-5; may be repeated\n"                  \
    "  --quiet            no progress bar and no remarks\n"

typedef struct crm_run {
    crm_scene *scene;
    const char *file;
    long n_steps;
    long stride; /* steps between samples */
} crm_run;

/* Reads arguments->files[0]; CRM_DONE, or CRM_USAGE with everything wrong on stderr. */
int crm_load(const crm_arguments *arguments, crm_run *run);
void crm_unload(crm_run *run);

/* The scene's own name, else the file's. */
const char *crm_run_name(const crm_run *run);

/* World of the run, sealed; NULL with a message on stderr. */
carom_world *crm_run_world(const crm_run *run);

/* Prints the faults, one a line, on stderr. */
void crm_print_problems(const crm_problems *problems);

#endif
