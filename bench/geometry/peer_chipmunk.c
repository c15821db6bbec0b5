/* Chipmunk 7: cpShapesCollide, on shapes with their world vertices worked out; its tree of boxes.
 */
#include "pairs.h"
#include "piles.h"

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

typedef struct tree {
    cpSpatialIndex *index;
    cpBB *boxes;
    int n_pairs;
} tree;

static cpBB box_of(void *object)
{
    return *(cpBB *)object;
}

static cpCollisionID count_pair(void *a, void *b, cpCollisionID id, void *self)
{
    const cpBB *x = a;
    const cpBB *y = b;
    ((tree *)self)->n_pairs += cpBBIntersects(*x, *y);
    return id;
}

static void move(tree *t, int n, const carom_box *boxes)
{
    for (int i = 0; i < n; i++) {
        t->boxes[i] =
            cpBBNew(boxes[i].lower.x, boxes[i].lower.y, boxes[i].upper.x, boxes[i].upper.y);
    }
}

static void *tree_create(int n, const carom_box *boxes)
{
    tree *t = malloc(sizeof *t);
    if (!t) abort();
    t->boxes = malloc((size_t)n * sizeof *t->boxes);
    if (!t->boxes) abort();
    t->index = cpBBTreeNew(box_of, NULL);
    move(t, n, boxes);
    for (int i = 0; i < n; i++) {
        cpSpatialIndexInsert(t->index, &t->boxes[i], (cpHashValue)(i + 1) * 2654435761u);
    }
    return t;
}

static int tree_step(void *self, int n, const carom_box *boxes)
{
    tree *t = self;
    t->n_pairs = 0;
    move(t, n, boxes);
    cpSpatialIndexReindexQuery(t->index, count_pair, t);
    return t->n_pairs;
}

static void tree_destroy(void *self)
{
    tree *t = self;
    cpSpatialIndexFree(t->index);
    free(t->boxes);
    free(t);
}

const finder CHIPMUNK_TREE = {"Chipmunk 7", tree_create, tree_step, tree_destroy};
