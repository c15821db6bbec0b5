/* Chipmunk 7: 10 iterations, as it comes, or four and sixteen times as many; nothing sleeps. */
#include "scene.h"

#include <chipmunk/chipmunk.h>
#include <math.h>
#include <stdlib.h>

typedef struct world {
    cpSpace *space;
    double dt;
    int n_bodies, n_shapes, n_joints;
    cpBody **bodies;
    cpShape **shapes;
    cpConstraint **joints;
} world;

static cpBody *new_body(const scene_body *b)
{
    if (b->moves == SCENE_KINEMATIC) return cpBodyNewKinematic();
    return b->moves ? cpBodyNew(b->mass, b->inertia) : cpBodyNewStatic();
}

static cpShape *new_shape(const scene *t, int k, cpBody *body)
{
    const scene_body *b = &t->bodies[k];
    cpVect corners[MAX_CORNERS];
    if (b->shape == SHAPE_DISC) return cpCircleShapeNew(body, b->hx, cpvzero);
    if (b->shape == SHAPE_BOX) return cpBoxShapeNew(body, 2 * b->hx, 2 * b->hy, 0);
    const scene_polygon *p = &t->polygons[k];
    for (int i = 0; i < p->n; i++) corners[i] = cpv(p->corners[i][0], p->corners[i][1]);
    return cpPolyShapeNewRaw(body, p->n, corners, 0);
}

static void add_body(world *s, const scene *t, int k)
{
    const scene_body *b = &t->bodies[k];
    cpBody *body = new_body(b);
    cpBodySetAngle(body, b->q[0]);
    cpBodySetPosition(body, cpv(b->q[1], b->q[2]));
    if (b->moves) {
        cpBodySetAngularVelocity(body, b->v[0]);
        cpBodySetVelocity(body, cpv(b->v[1], b->v[2]));
    }
    s->bodies[s->n_bodies++] = cpSpaceAddBody(s->space, body);
    if (b->shape == SHAPE_NONE) return;
    cpShape *shape = new_shape(t, k, body);
    /* It multiplies those of a pair. */
    cpShapeSetFriction(shape, sqrt(b->friction));
    cpShapeSetElasticity(shape, sqrt(b->restitution));
    s->shapes[s->n_shapes++] = cpSpaceAddShape(s->space, shape);
}

static void *create_with(const scene *s, int iterations)
{
    world *self = calloc(1, sizeof *self);
    if (!self) abort();
    self->space = cpSpaceNew();
    cpSpaceSetIterations(self->space, iterations);
    self->dt = s->dt;
    self->bodies = calloc((size_t)s->n_bodies, sizeof *self->bodies);
    self->shapes = calloc((size_t)s->n_bodies, sizeof *self->shapes);
    self->joints = calloc((size_t)s->n_pins + 1, sizeof *self->joints);
    if (!self->bodies || !self->shapes || !self->joints) abort();
    cpSpaceSetGravity(self->space, cpv(0, -s->gravity));
    for (int k = 0; k < s->n_bodies; k++) add_body(self, s, k);
    for (int k = 0; k < s->n_pins; k++) {
        const scene_pin *p = &s->pins[k];
        cpConstraint *j = cpPivotJointNew(self->bodies[p->a], self->bodies[p->b], cpv(p->x, p->y));
        cpConstraintSetCollideBodies(j, cpFalse);
        self->joints[self->n_joints++] = cpSpaceAddConstraint(self->space, j);
    }
    return self;
}

static void step(void *self, counters *c)
{
    world *s = self;
    (void)c;
    cpSpaceStep(s->space, s->dt);
}

static void place(void *self, int body, double q[3])
{
    const world *s = self;
    const cpVect p = cpBodyGetPosition(s->bodies[body]);
    q[0] = cpBodyGetAngle(s->bodies[body]);
    q[1] = p.x;
    q[2] = p.y;
}

static void speed(void *self, int body, double v[3])
{
    const world *s = self;
    const cpVect u = cpBodyGetVelocity(s->bodies[body]);
    v[0] = cpBodyGetAngularVelocity(s->bodies[body]);
    v[1] = u.x;
    v[2] = u.y;
}

static void destroy(void *self)
{
    world *s = self;
    for (int k = 0; k < s->n_joints; k++) {
        cpSpaceRemoveConstraint(s->space, s->joints[k]);
        cpConstraintFree(s->joints[k]);
    }
    for (int k = 0; k < s->n_shapes; k++) {
        cpSpaceRemoveShape(s->space, s->shapes[k]);
        cpShapeFree(s->shapes[k]);
    }
    for (int k = 0; k < s->n_bodies; k++) {
        cpSpaceRemoveBody(s->space, s->bodies[k]);
        cpBodyFree(s->bodies[k]);
    }
    cpSpaceFree(s->space);
    free(s->shapes);
    free(s->bodies);
    free(s->joints);
    free(s);
}

static void *create(const scene *s)
{
    return create_with(s, 10);
}

static void *create_4(const scene *s)
{
    return create_with(s, 40);
}

static void *create_16(const scene *s)
{
    return create_with(s, 160);
}

const contender CHIPMUNK[3] = {{"Chipmunk 7", create, step, place, destroy, speed},
                               {"Chipmunk 7 x4", create_4, step, place, destroy, speed},
                               {"Chipmunk 7 x16", create_16, step, place, destroy, speed}};
