/* open_file.c: scenes from files. */
#include "clients/c/scene/remote.h"
#include "parts.h"

/* The first sentence about the file, and how many more there are. */
static carom_client_code fail_file(carom_client *c, const crm_problems *problems)
{
    const int more = problems->count - 1;
    if (problems->no_memory) {
        return crm_client_fail(c, CAROM_CLIENT_E_MEMORY, "%s: out of memory", problems->file);
    }
    if (more > 0) {
        return crm_client_fail(c, CAROM_CLIENT_E_ARGUMENT, "%s (and %d more)", problems->text[0],
                               more);
    }
    return crm_client_fail(c, CAROM_CLIENT_E_ARGUMENT, "%s", problems->text[0]);
}

static carom_client_code open_scene(carom_client *c, const crm_scene *file)
{
    carom_client_scene scene;
    if (!crm_scene_client(file, &scene)) {
        return crm_client_fail(c, CAROM_CLIENT_E_MEMORY, "no memory for the scene");
    }
    const carom_client_code code = carom_client_open(c, &scene);
    crm_scene_client_free(&scene);
    return code;
}

carom_client_code carom_client_open_file(carom_client *c, const char *path)
{
    if (!path) return crm_client_fail(c, CAROM_CLIENT_E_ARGUMENT, "no scene file is named");
    crm_problems problems = crm_problems_of(path);
    crm_scene *file = crm_scene_read(&problems);
    const carom_client_code code = file ? open_scene(c, file) : fail_file(c, &problems);
    crm_problems_free(&problems);
    if (code < 0) {
        crm_scene_free(file);
    } else {
        c->file = file;
    }
    return code;
}

void crm_client_forget_file(carom_client *c)
{
    crm_scene_free(c->file);
    c->file = NULL;
}

int crm_client_file_forces(const carom_client *c, int count, carom_client_force **forces, int *n)
{
    *forces = NULL;
    *n = 0;
    return !c->file || crm_scene_forces(c->file, c->info.step, count, forces, n);
}
