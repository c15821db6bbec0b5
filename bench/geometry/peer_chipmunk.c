/* cpShapesCollide of Chipmunk 7, on shapes with their world vertices worked out. */
#include "pairs.h"

#include <chipmunk/chipmunk.h>
#include <stdlib.h>

typedef struct scene {
    cpBody *body[2 * N_PAIRS];
    cpShape *shape[2 * N_PAIRS];
} scene;

static void place(scene *s, int k, const pairs *p, carom_pose q)
{
    cpVect v[MAX_VERTICES];
    for (int i = 0; i < p->n; i++) v[i] = cpv(p->vertices[i].x, p->vertices[i].y);
    s->body[k] = cpBodyNewKinematic();
    s->shape[k] = cpPolyShapeNewRaw(s->body[k], p->n, v, 0.5 * MARGIN);
    cpBodySetAngle(s->body[k], q.angle);
    cpBodySetPosition(s->body[k], cpv(q.x, q.y));
    cpShapeCacheBB(s->shape[k]);
}

static void *create(const pairs *p)
{
    scene *s = malloc(sizeof *s);
    if (!s) abort();
    for (int k = 0; k < N_PAIRS; k++) {
        place(s, 2 * k, p, p->a[k]);
        place(s, 2 * k + 1, p, p->b[k]);
    }
    return s;
}

static int run(void *self, double *sum)
{
    const scene *s = self;
    int n = 0;
    for (int k = 0; k < N_PAIRS; k++) {
        const cpContactPointSet m = cpShapesCollide(s->shape[2 * k], s->shape[2 * k + 1]);
        n += m.count;
        if (m.count) *sum += m.normal.x;
    }
    return n;
}

static void destroy(void *self)
{
    scene *s = self;
    for (int k = 0; k < 2 * N_PAIRS; k++) {
        cpShapeFree(s->shape[k]);
        cpBodyFree(s->body[k]);
    }
    free(s);
}

const contender CHIPMUNK = {"Chipmunk 7", MAX_VERTICES, create, run, destroy};
