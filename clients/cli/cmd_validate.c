#include "clients/c/scene/scene.h"
#include "cmd.h"
#include "io/load.h"

#include <limits.h>
#include <stdio.h>

/* What only the engine can tell: settings out of range, an initial overlap that is refused. */
static void check_world(crm_problems *problems, const crm_scene *scene)
{
    carom_world *world = NULL;
    char why[512];
    carom_status s = crm_scene_world(scene, NULL, &world, why, sizeof why);
    if (s < 0) {
        crm_fault(problems, NULL, "%s", why);
        return;
    }
    s = carom_world_seal(world);
    if (s < 0) crm_fault(problems, NULL, "%s", carom_world_error(world));
    carom_world_destroy(world);
}

static int validate_file(const char *file)
{
    crm_problems problems = crm_problems_of(file);
    crm_scene *scene = crm_scene_read(&problems);
    if (scene) check_world(&problems, scene);
    crm_print_problems(&problems);
    if (crm_faulty(&problems)) {
        fprintf(stderr, "%s: %d %s\n", problems.file, problems.count,
                problems.count == 1 ? "error" : "errors");
    } else {
        printf("%s: valid, %d bodies, %d joints\n", problems.file, scene->n_bodies,
               scene->n_joints);
    }
    const int code = crm_faulty(&problems) ? CRM_USAGE : CRM_DONE;
    crm_scene_free(scene);
    crm_problems_free(&problems);
    return code;
}

static int run(const crm_arguments *a)
{
    int code = CRM_DONE;
    for (int i = 0; i < a->n_files; i++) {
        if (validate_file(a->files[i]) != CRM_DONE) code = CRM_USAGE;
    }
    return code;
}

static const crm_option options[] = {{NULL, 0}};

const crm_command crm_command_validate = {
    "validate",
    "validate SCENE...",
    "reads scenes and names everything wrong with them at once",
    "Each error names the file, the place in it and the remedy; exit code 1 when there is one.\n",
    options,
    1,
    INT_MAX,
    run};
