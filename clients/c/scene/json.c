#include "json.h"

#include "scan.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PLACE_MAX = 256, TEXT_MAX = 1024, READ_BLOCK = 65536 };

crm_problems crm_problems_of(const char *file)
{
    const crm_problems problems = {file, 0, NULL, 0};
    return problems;
}

int crm_faulty(const crm_problems *problems)
{
    return problems->count > 0 || problems->no_memory;
}

void *crm_make(crm_problems *problems, size_t n, size_t size)
{
    void *p = calloc(n ? n : 1, size);
    if (!p) problems->no_memory = 1;
    return p;
}

void *crm_regrow(crm_problems *problems, void *old, size_t n, size_t size)
{
    void *p = n > SIZE_MAX / 2 / size ? NULL : realloc(old, n * size);
    if (!p) problems->no_memory = 1;
    return p;
}

void crm_problems_free(crm_problems *problems)
{
    for (int i = 0; i < problems->count; i++) free(problems->text[i]);
    free(problems->text);
    *problems = crm_problems_of(problems->file);
}

static void place_append(char *text, size_t size, const char *name, const char *dot)
{
    const size_t used = strlen(text);
    snprintf(text + used, size - used, "%s%s", used ? dot : "", name);
}

void crm_node_place(const crm_node *node, char *text, size_t size)
{
    if (!node->up) {
        text[0] = '\0';
        return;
    }
    crm_node_place(node->up, text, size);
    char item[16];
    snprintf(item, sizeof item, "[%d]", node->index);
    if (node->key) {
        place_append(text, size, node->key, ".");
    } else {
        place_append(text, size, item, "");
    }
}

/* A copy of the sentence joins the list. */
static void keep(crm_problems *problems, const char *sentence)
{
    const size_t n = (size_t)problems->count;
    char **list = crm_regrow(problems, problems->text, n + 1, sizeof *list);
    if (!list) return;
    problems->text = list;
    list[n] = crm_make(problems, strlen(sentence) + 1, 1);
    if (!list[n]) return;
    strcpy(list[n], sentence);
    problems->count++;
}

void crm_fault(crm_problems *problems, const crm_node *at, const char *format, ...)
{
    char place[PLACE_MAX] = "";
    char sentence[TEXT_MAX];
    if (at) crm_node_place(at, place, sizeof place);
    int n = snprintf(sentence, sizeof sentence, "%s: %s%s", problems->file, place,
                     place[0] ? ": " : "");
    if (n < 0 || n >= TEXT_MAX) n = TEXT_MAX - 1;
    va_list list;
    va_start(list, format);
    vsnprintf(sentence + n, sizeof sentence - (size_t)n, format, list);
    va_end(list);
    keep(problems, sentence);
}

/* All bytes of the stream; NULL when reading fails. */
static char *read_stream(crm_problems *problems, FILE *f, size_t *length)
{
    char *text = NULL;
    size_t n = 0;
    size_t got = READ_BLOCK;
    while (got == READ_BLOCK) {
        char *more = crm_regrow(problems, text, n + READ_BLOCK, 1);
        if (!more) break;
        text = more;
        got = fread(text + n, 1, READ_BLOCK, f);
        n += got;
    }
    if (problems->no_memory || ferror(f)) {
        free(text);
        return NULL;
    }
    text[n] = '\0'; /* the last block is never full */
    *length = n;
    return text;
}

static char *read_file(crm_problems *problems, size_t *length)
{
    const int is_stdin = strcmp(problems->file, "-") == 0;
    if (is_stdin) problems->file = "standard input";
    errno = 0;
    FILE *f = is_stdin ? stdin : fopen(problems->file, "rb");
    char *text = f ? read_stream(problems, f, length) : NULL;
    const int reason = errno;
    if (f && !is_stdin) fclose(f);
    if (!text && !problems->no_memory) {
        crm_fault(problems, NULL, "cannot be read: %s", strerror(reason));
    }
    return text;
}

/* The mark that some editors put in front of UTF-8 becomes blanks. */
static void blank_byte_order_mark(char *text)
{
    static const char mark[] = "\xEF\xBB\xBF";
    if (strncmp(text, mark, 3) == 0) memset(text, ' ', 3);
}

/* Overwrites the word, wherever it stands outside of texts, by "" and blanks: what comes after it
 * keeps its line and column. */
static void blank_word(char *text, const char *word)
{
    const size_t n = strlen(word);
    int in_text = 0;
    for (char *c = text; *c; c++) {
        if (in_text && c[0] == '\\' && c[1]) {
            c++;
        } else if (*c == '"') {
            in_text = !in_text;
        } else if (!in_text && strncmp(c, word, n) == 0) {
            memset(c, ' ', n);
            c[0] = c[1] = '"';
            c++;
        }
    }
}

static json_t *load(crm_problems *problems, int of_python)
{
    size_t length = 0;
    char *text = read_file(problems, &length);
    if (!text) return NULL;
    blank_byte_order_mark(text);
    if (of_python) {
        blank_word(text, "-Infinity");
        blank_word(text, "Infinity");
        blank_word(text, "NaN");
    }
    json_error_t error;
    json_t *json = json_loadb(text, length, 0, &error);
    if (!json && strspn(text, " \t\r\n") == length) {
        crm_fault(problems, NULL, "the file is empty");
    } else if (!json) {
        crm_fault(problems, NULL, "line %d, column %d: %s", error.line, error.column, error.text);
    } else if (crm_scan_duplicates(text, problems) == 0 && !problems->no_memory) {
        /* Keys that differ in the file only by escapes are left to jansson. */
        json_t *again = json_loadb(text, length, JSON_REJECT_DUPLICATES, &error);
        if (!again) crm_fault(problems, NULL, "line %d: %s", error.line, error.text);
        json_decref(again);
    }
    free(text);
    return json;
}

json_t *crm_json_load(crm_problems *problems)
{
    return load(problems, 0);
}

json_t *crm_json_load_python(crm_problems *problems)
{
    return load(problems, 1);
}

crm_node crm_root(const json_t *json)
{
    const crm_node root = {json, NULL, NULL, 0};
    return root;
}

crm_node crm_member(const crm_node *object, const char *key)
{
    const crm_node member = {json_object_get(object->json, key), object, key, 0};
    return member;
}

crm_node crm_item(const crm_node *array, int index)
{
    const crm_node item = {json_array_get(array->json, (size_t)index), array, NULL, index};
    return item;
}

int crm_length(const crm_node *array)
{
    return (int)json_array_size(array->json);
}

/* "is 3", "is a text": what stands there instead. */
static void describe(const json_t *json, char *text, size_t size)
{
    static const char *const kinds[] = {"an object", "an array", "a text", "a number",
                                        "a number",  "true",     "false",  "null"};
    if (!json) {
        snprintf(text, size, "missing");
    } else if (json_is_number(json)) {
        snprintf(text, size, "%.17g", json_number_value(json));
    } else if (json_is_string(json)) {
        snprintf(text, size, "\"%.40s\"", json_string_value(json));
    } else {
        snprintf(text, size, "%s", kinds[json_typeof(json)]);
    }
}

static void fault_kind(crm_problems *problems, const crm_node *node, const char *wanted)
{
    char found[64];
    describe(node->json, found, sizeof found);
    crm_fault(problems, node, "must be %s, is %s", wanted, found);
}

/* The known names, comma separated. */
static void join_names(const char *const *names, char *text, size_t size)
{
    text[0] = '\0';
    for (int i = 0; names[i]; i++) place_append(text, size, names[i], ", ");
}

static int is_known(const char *key, const char *const *keys)
{
    if (key[0] == '_' || strcmp(key, "reference") == 0) return 1;
    for (int i = 0; keys[i]; i++) {
        if (strcmp(key, keys[i]) == 0) return 1;
    }
    return 0;
}

int crm_check_keys(crm_problems *problems, const crm_node *object, const char *const *keys)
{
    if (!json_is_object(object->json)) {
        fault_kind(problems, object, "an object {...}");
        return 0;
    }
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)object->json, key, value)
    {
        if (is_known(key, keys)) continue;
        const crm_node at = {value, object, key, 0};
        char known[512];
        join_names(keys, known, sizeof known);
        crm_fault(problems, &at, "unknown key; known here: %s (keys that start with _ are ignored)",
                  known);
    }
    return 1;
}

int crm_get_number(crm_problems *problems, const crm_node *node, double *value)
{
    if (!node->json) return 0;
    if (!json_is_number(node->json)) {
        fault_kind(problems, node, "a number");
        return 0;
    }
    *value = json_number_value(node->json);
    return 1;
}

int crm_get_numbers(crm_problems *problems, const crm_node *node, int count, double *values)
{
    if (!node->json) return 0;
    if (!json_is_array(node->json) || crm_length(node) != count) {
        crm_fault(problems, node, "must be an array of %d numbers", count);
        return 0;
    }
    int good = 1;
    for (int i = 0; i < count; i++) {
        const crm_node item = crm_item(node, i);
        good &= crm_get_number(problems, &item, &values[i]);
    }
    return good;
}

int crm_get_integer(crm_problems *problems, const crm_node *node, double low, double high,
                    json_int_t *value)
{
    double x = 0;
    if (!crm_get_number(problems, node, &x)) return 0;
    if (!(x >= low && x <= high && floor(x) == x)) {
        crm_fault(problems, node, "must be a whole number from %.0f to %.0f, is %.17g", low, high,
                  x);
        return 0;
    }
    *value = (json_int_t)x;
    return 1;
}

int crm_get_flag(crm_problems *problems, const crm_node *node, int *value)
{
    if (!node->json) return 0;
    if (!json_is_boolean(node->json)) {
        fault_kind(problems, node, "true or false");
        return 0;
    }
    *value = json_is_true(node->json);
    return 1;
}

int crm_get_text(crm_problems *problems, const crm_node *node, const char **value)
{
    if (!node->json) return 0;
    if (!json_is_string(node->json)) {
        fault_kind(problems, node, "a text");
        return 0;
    }
    *value = json_string_value(node->json);
    return 1;
}

int crm_get_word(crm_problems *problems, const crm_node *node, const char *const *words)
{
    const char *text = NULL;
    if (!crm_get_text(problems, node, &text)) return -1;
    for (int i = 0; words[i]; i++) {
        if (strcmp(text, words[i]) == 0) return i;
    }
    char known[512];
    join_names(words, known, sizeof known);
    crm_fault(problems, node, "\"%.40s\" is not known; one of: %s", text, known);
    return -1;
}
