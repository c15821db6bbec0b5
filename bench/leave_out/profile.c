#include "profile.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int compare(const void *a, const void *b)
{
    return strcmp(a, b);
}

/* Cut where it is longer: no two functions differ only after 63 letters. */
static void copy_name(char to[64], const char *from)
{
    size_t n = strlen(from);
    if (n > 63) n = 63;
    memcpy(to, from, n);
    to[n] = '\0';
}

static void add(names *all, const char *name)
{
    if (all->n == all->max) {
        all->max = 2 * all->max + 256;
        all->list = realloc(all->list, (size_t)all->max * sizeof *all->list);
        if (!all->list) abort();
    }
    copy_name(all->list[all->n++], name);
}

/* "find.constprop.0" and "find'2" are find. */
static void strip(char *name)
{
    name[strcspn(name, ".'\n")] = '\0';
}

static void sort(names *all)
{
    int n = 0;
    qsort(all->list, (size_t)all->n, sizeof *all->list, compare);
    for (int k = 0; k < all->n; k++) {
        if (n > 0 && !strcmp(all->list[n - 1], all->list[k])) continue;
        memmove(all->list[n++], all->list[k], sizeof *all->list);
    }
    all->n = n;
}

names library_functions(const char *archives)
{
    names all = {0, 0, NULL};
    char command[4096];
    char line[512];
    snprintf(command, sizeof command, "nm --defined-only");
    char *copy = malloc(strlen(archives) + 1);
    if (!copy) abort();
    strcpy(copy, archives);
    for (char *p = strtok(copy, ":"); p; p = strtok(NULL, ":")) {
        const size_t used = strlen(command);
        snprintf(command + used, sizeof command - used, " '%s'", p);
    }
    free(copy);
    const size_t used = strlen(command);
    snprintf(command + used, sizeof command - used, " 2>/dev/null");
    FILE *f = popen(command, "r");
    while (f && fgets(line, sizeof line, f)) {
        char type;
        char name[256];
        if (sscanf(line, "%*s %c %255s", &type, name) != 2 || toupper(type) != 'T') continue;
        strip(name);
        add(&all, name);
    }
    if (f) pclose(f);
    sort(&all);
    return all;
}

int names_have(const names *all, const char *name)
{
    return all->n && bsearch(name, all->list, (size_t)all->n, sizeof *all->list, compare) != NULL;
}

void names_free(names *all)
{
    free(all->list);
}

/* Names of a file of callgrind's: "(12) name" the first time, "(12)" after that. */
typedef struct dictionary {
    int max;
    char (*list)[64];
} dictionary;

static char *look_up(dictionary *d, const char *text)
{
    char name[256];
    int id = 0;
    if (sscanf(text, "(%d) %255s", &id, name) < 1 || id < 0 || id > 1 << 20) return NULL;
    if (id >= d->max) {
        const int max = 2 * id + 64;
        d->list = realloc(d->list, (size_t)max * sizeof *d->list);
        if (!d->list) abort();
        memset(d->list[d->max], 0, (size_t)(max - d->max) * sizeof *d->list);
        d->max = max;
    }
    const char *after = strchr(text, ')');
    if (after && after[1] == ' ') {
        copy_name(d->list[id], after + 2);
        strip(d->list[id]);
    }
    return d->list[id];
}

static void read_profile(FILE *f, const names *library, profile *p)
{
    dictionary d = {0, NULL};
    char line[4096];
    while (fgets(line, sizeof line, f)) {
        if (!strncmp(line, "fn=", 3)) {
            const char *name = look_up(&d, line + 3);
            if (!name) continue;
            if (names_have(library, name)) add(&p->entered, name);
            p->ccd |= !strncmp(name, "ccd", 3);
            p->amd |= !strncmp(name, "amd_", 4);
        } else if (!strncmp(line, "cfn=", 4)) {
            look_up(&d, line + 4);
        } else if (!strncmp(line, "summary:", 8)) {
            p->instructions = strtod(line + 8, NULL);
        }
    }
    free(d.list);
    sort(&p->entered);
}

profile profile_of(const char *command, const names *library)
{
    profile p = {-1, {0, 0, NULL}, 0, 0};
    char path[] = "/tmp/leave_out_XXXXXX";
    char all[4096];
    const int file = mkstemp(path);
    if (file < 0) return p;
    close(file);
    snprintf(all, sizeof all,
             "valgrind --tool=callgrind --callgrind-out-file=%s %s >/dev/null 2>&1", path, command);
    if (system(all) == 0) {
        FILE *f = fopen(path, "r");
        if (f) {
            read_profile(f, library, &p);
            fclose(f);
        }
    }
    unlink(path);
    return p;
}
