#include "program.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

static char folder[64];

static char *path_of(const char *name, char *path)
{
    snprintf(path, 128, "%s/%s", folder, name);
    return path;
}

char *program_read(const char *name)
{
    char path[128];
    FILE *f = fopen(path_of(name, path), "rb");
    if (!f) return NULL;
    fseek(f, 0, SEEK_END);
    const size_t size = (size_t)ftell(f);
    rewind(f);
    char *text = malloc(size + 1);
    assert_non_null(text);
    assert_int_equal(fread(text, 1, size, f), size);
    text[size] = '\0';
    fclose(f);
    return text;
}

void program_write(const char *name, const char *text)
{
    char path[128];
    FILE *f = fopen(path_of(name, path), "wb");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
}

program_call program_run(const char *arguments)
{
    char command[2048] = "";
    snprintf(command, sizeof command, "cd %s || exit 99; %s ", folder, CAROM_PROGRAM);
    for (const char *c = arguments; *c; c++) {
        const char one[2] = {*c, '\0'};
        strcat(command, *c == '%' ? TEST_DATA : one);
    }
    strcat(command, " >out 2>err");
    const int status = system(command);
    assert_true(WIFEXITED(status));
    const program_call c = {WEXITSTATUS(status), program_read("out"), program_read("err")};
    return c;
}

void program_free(program_call *c)
{
    free(c->out);
    free(c->err);
}

void program_refuses(const char *arguments, const char *message)
{
    program_call c = program_run(arguments);
    if (c.code != 1 || c.out[0] || !strstr(c.err, message)) {
        fail_msg("carom %s\n exit %d, stdout \"%s\"\n stderr: %s wanted: %s", arguments, c.code,
                 c.out, c.err, message);
    }
    program_free(&c);
}

json_t *program_line(const char *text, int k)
{
    for (; k > 0 && text; k--) {
        text = strchr(text, '\n');
        if (text) text++;
    }
    if (!text || !*text) return NULL;
    json_error_t error;
    json_t *json = json_loads(text, JSON_DISABLE_EOF_CHECK, &error);
    if (!json) fail_msg("not JSON: %s in %.200s", error.text, text);
    return json;
}

int program_count_lines(const char *text)
{
    int n = 0;
    for (; *text; text++) n += *text == '\n';
    return n;
}

double program_number(const json_t *object, const char *key)
{
    const json_t *x = json_object_get(object, key);
    if (!json_is_number(x)) fail_msg("no number \"%s\"", key);
    return json_number_value(x);
}

double program_entry(const json_t *object, const char *key, size_t i)
{
    const json_t *x = json_array_get(json_object_get(object, key), i);
    if (!json_is_number(x)) fail_msg("no number %s[%zu]", key, i);
    return json_number_value(x);
}

int program_make_folder(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/carom_test_XXXXXX");
    return mkdtemp(folder) ? 0 : -1;
}

int program_remove_folder(void **state)
{
    (void)state;
    char command[128];
    snprintf(command, sizeof command, "rm -r %s", folder);
    return system(command);
}

const char *program_folder(void)
{
    return folder;
}
