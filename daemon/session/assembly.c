/* assembly.c: scenes in pieces. */
#include "parts.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static size_t held(const crm_assembly *a)
{
    return (size_t)a->size + (size_t)a->n_chunks;
}

void crm_assembly_clear(crm_assembly *a, crm_budget *budget)
{
    if (a->seq) crm_budget_give(budget, held(a));
    free(a->bytes);
    free(a->has);
    *a = (crm_assembly){0};
}

static int check_piece(const carom_scene_chunk_t *c, int max_size, char *text)
{
    if (c->scene_bytes < 1 || c->scene_bytes > max_size) {
        snprintf(text, CRM_TEXT, "scene_bytes = %d is outside 1 to %d (--max-message)",
                 c->scene_bytes, max_size);
        return 0;
    }
    if (c->chunk_stride < 1 || c->chunk_stride > c->scene_bytes) {
        snprintf(text, CRM_TEXT, "chunk_stride = %d is outside 1 to scene_bytes = %d",
                 c->chunk_stride, c->scene_bytes);
        return 0;
    }
    const int64_t at = (int64_t)c->chunk_index * c->chunk_stride;
    if (c->chunk_index < 0 || at >= c->scene_bytes || c->chunk_offset != at) {
        snprintf(text, CRM_TEXT, "chunk_index = %d at chunk_offset = %d: not a piece of %d bytes",
                 c->chunk_index, c->chunk_offset, c->scene_bytes);
        return 0;
    }
    const int rest = c->scene_bytes - c->chunk_offset;
    const int expected = rest < c->chunk_stride ? rest : c->chunk_stride;
    if (c->num_bytes != expected) {
        snprintf(text, CRM_TEXT, "num_bytes = %d in piece %d: must be %d", c->num_bytes,
                 c->chunk_index, expected);
        return 0;
    }
    return 1;
}

/* 1: empty, ready for the scene this piece belongs to. */
static int start(crm_assembly *a, crm_budget *budget, const carom_scene_chunk_t *c)
{
    crm_assembly_clear(a, budget);
    a->size = c->scene_bytes;
    a->stride = c->chunk_stride;
    a->n_chunks = (a->size - 1) / a->stride + 1;
    a->n_missing = a->n_chunks;
    if (!crm_budget_take(budget, held(a))) return 0;
    a->seq = c->seq;
    a->bytes = malloc((size_t)a->size);
    a->has = calloc((size_t)a->n_chunks, 1);
    if (a->bytes && a->has) return 1;
    crm_assembly_clear(a, budget);
    return 0;
}

int crm_assembly_add(crm_assembly *a, crm_budget *budget, const carom_scene_chunk_t *c,
                     int max_size, char *text)
{
    if (!check_piece(c, max_size, text)) return 0;
    const int same = a->seq == c->seq && a->size == c->scene_bytes && a->stride == c->chunk_stride;
    if (!same && !start(a, budget, c)) return -1;
    memcpy(a->bytes + c->chunk_offset, c->chunk_data, (size_t)c->num_bytes);
    if (!a->has[c->chunk_index]) a->n_missing--;
    a->has[c->chunk_index] = 1;
    return 1;
}
