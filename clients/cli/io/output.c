#include "output.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

int crm_output_open(crm_output *out, const char *path)
{
    out->file = stdout;
    out->name = "standard output";
    if (!path || strcmp(path, "-") == 0) return 1;
    out->name = path;
    out->file = fopen(path, "w");
    if (out->file) return 1;
    fprintf(stderr, "carom: %s: cannot be written: %s\n", path, strerror(errno));
    return 0;
}

int crm_output_close(crm_output *out)
{
    if (!out->file) return 1;
    int good = fflush(out->file) == 0 && !ferror(out->file);
    if (out->file != stdout && fclose(out->file) != 0) good = 0;
    out->file = NULL;
    if (!good) fprintf(stderr, "carom: %s: not everything could be written\n", out->name);
    return good;
}

void crm_put_raw(crm_output *out, const char *json)
{
    fputs(json, out->file);
}

void crm_put_number(crm_output *out, double x)
{
    char text[40];
    if (!(fabs(x) < HUGE_VAL)) {
        crm_put_raw(out, "null");
        return;
    }
    for (int digits = 15; digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, x);
        if (memcmp(&(double){strtod(text, NULL)}, &x, sizeof x) == 0) break;
    }
    crm_put_raw(out, text);
}

void crm_put_numbers(crm_output *out, int n, const double *x)
{
    crm_put_raw(out, "[");
    for (int i = 0; i < n; i++) {
        if (i) crm_put_raw(out, ",");
        crm_put_number(out, x[i]);
    }
    crm_put_raw(out, "]");
}

void crm_put_text(crm_output *out, const char *text)
{
    fputc('"', out->file);
    for (const char *c = text ? text : ""; *c; c++) {
        const unsigned char u = (unsigned char)*c;
        if (u == '"' || u == '\\') {
            fprintf(out->file, "\\%c", u);
        } else if (u < 0x20) {
            fprintf(out->file, "\\u%04x", u);
        } else {
            fputc(u, out->file);
        }
    }
    fputc('"', out->file);
}

void crm_put_key(crm_output *out, int first, const char *key)
{
    fprintf(out->file, "%s\"%s\":", first ? "" : ",", key);
}

void crm_put_field(crm_output *out, int first, const char *key, double x)
{
    crm_put_key(out, first, key);
    crm_put_number(out, x);
}
