#include "scene.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SHAPE_CIRCLE, SHAPE_HULL, SHAPE_CAPSULE, SHAPE_SEGMENT };

static const char *const shape_words[] = {"circle", "hull", "capsule", "segment", NULL};

/* Keys of each type, in the order of shape_words. */
static const char *const circle_keys[] = {"type", "radius", "center", NULL};
static const char *const round_keys[] = {"type", "vertices", "radius", NULL};
static const char *const segment_keys[] = {"type", "vertices", NULL};
static const char *const *const shape_keys[] = {circle_keys, round_keys, round_keys, segment_keys};

void crm_shape_free(carom_shape *shape)
{
    free((void *)shape->vertices); /* the reader's own copy */
    memset(shape, 0, sizeof *shape);
}

static carom_vec2 *read_vertices(crm_problems *problems, const crm_node *node, carom_shape *shape)
{
    const crm_node list = crm_member(node, "vertices");
    if (crm_length(&list) == 0) {
        crm_fault(problems, &list, "must be an array of points [x, y]");
        return NULL;
    }
    const int n = crm_length(&list);
    carom_vec2 *v = crm_make(problems, (size_t)n, sizeof *v);
    if (!v) return NULL;
    shape->count = n;
    shape->vertices = v;
    for (int i = 0; i < n; i++) {
        const crm_node item = crm_item(&list, i);
        double xy[2] = {0, 0};
        if (!crm_get_numbers(problems, &item, 2, xy)) shape->count = 0;
        v[i].x = xy[0];
        v[i].y = xy[1];
    }
    return shape->count ? v : NULL;
}

static int read_circle(crm_problems *problems, const crm_node *node, carom_shape *shape)
{
    const crm_node radius = crm_member(node, "radius");
    const crm_node center = crm_member(node, "center");
    carom_vec2 *v = crm_make(problems, 1, sizeof *v);
    if (!v) return 0;
    double xy[2] = {0, 0};
    shape->vertices = v;
    shape->count = 1;
    const int good = !center.json || crm_get_numbers(problems, &center, 2, xy);
    v->x = xy[0];
    v->y = xy[1];
    if (!radius.json) crm_fault(problems, &radius, "must be given, in meters");
    return crm_get_number(problems, &radius, &shape->radius) && good;
}

static int read_outline(crm_problems *problems, const crm_node *node, int type, carom_shape *shape)
{
    const crm_node radius = crm_member(node, "radius");
    const crm_node vertices = crm_member(node, "vertices");
    int good = read_vertices(problems, node, shape) != NULL;
    if (type == SHAPE_CAPSULE && !radius.json) {
        crm_fault(problems, &radius, "must be given, in meters");
        good = 0;
    }
    if (type != SHAPE_SEGMENT && radius.json) {
        good &= crm_get_number(problems, &radius, &shape->radius);
    }
    if (!good) return 0;
    if (type == SHAPE_HULL ? shape->count >= 3 : shape->count == 2) return 1;
    crm_fault(problems, &vertices, "a %s has %s, here are %d", shape_words[type],
              type == SHAPE_HULL ? "three vertices or more" : "two vertices", shape->count);
    return 0;
}

/* What carom_shape_check finds, at the vertex or the key it is about. */
static int check_shape(crm_problems *problems, const crm_node *node, const carom_shape *shape,
                       int type)
{
    carom_shape_error error;
    if (carom_shape_check(shape, &error) == CAROM_OK) {
        if (type != SHAPE_CAPSULE || shape->radius > 0) return 1;
        const crm_node at = crm_member(node, "radius");
        crm_fault(problems, &at, "must be > 0 for a capsule; radius 0 is a segment");
        return 0;
    }
    char text[256];
    carom_shape_error_text(error, text, sizeof text);
    const crm_node vertices = crm_member(node, "vertices");
    const crm_node vertex = crm_item(&vertices, error.vertex);
    const crm_node radius = crm_member(node, "radius");
    const crm_node *at = error.fault == CAROM_SHAPE_RADIUS ? &radius : node;
    if (error.vertex >= 0 && type != SHAPE_CIRCLE) at = &vertex;
    crm_fault(problems, at, "%s", text);
    return 0;
}

int crm_shape_read(crm_problems *problems, const crm_node *node, carom_shape *shape)
{
    static const char *const any_key[] = {"type", "radius", "center", "vertices", NULL};
    memset(shape, 0, sizeof *shape);
    const crm_node type_node = crm_member(node, "type");
    if (!type_node.json) {
        if (!crm_check_keys(problems, node, any_key)) return 0;
        crm_fault(problems, &type_node, "must be given: circle, hull, capsule or segment");
        return 0;
    }
    const int type = crm_get_word(problems, &type_node, shape_words);
    if (type < 0) return 0;
    crm_check_keys(problems, node, shape_keys[type]);
    const int good = type == SHAPE_CIRCLE ? read_circle(problems, node, shape)
                                          : read_outline(problems, node, type, shape);
    return good && check_shape(problems, node, shape, type);
}
