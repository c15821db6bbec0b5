// b2CollidePolygons of Box2D 2.4, from transforms with their rotation worked out.
#include "pairs.h"

#include <box2d/box2d.h>
#include <vector>

namespace {

struct scene {
    b2PolygonShape shape;
    std::vector<b2Transform> a;
    std::vector<b2Transform> b;
};

b2Transform transform(carom_pose q)
{
    return b2Transform(b2Vec2(float(q.x), float(q.y)), b2Rot(float(q.angle)));
}

void *create(const pairs *p)
{
    scene *s = new scene;
    b2Vec2 v[b2_maxPolygonVertices];
    for (int i = 0; i < p->n; i++) v[i].Set(float(p->vertices[i].x), float(p->vertices[i].y));
    s->shape.Set(v, p->n);
    for (int k = 0; k < N_PAIRS; k++) {
        s->a.push_back(transform(p->a[k]));
        s->b.push_back(transform(p->b[k]));
    }
    return s;
}

int run(void *self, double *sum)
{
    const scene *s = static_cast<scene *>(self);
    int n = 0;
    for (int k = 0; k < N_PAIRS; k++) {
        b2Manifold m;
        b2CollidePolygons(&m, &s->shape, s->a[k], &s->shape, s->b[k]);
        n += m.pointCount;
        if (m.pointCount) *sum += double(m.localNormal.x);
    }
    return n;
}

void destroy(void *self)
{
    delete static_cast<scene *>(self);
}

} // namespace

const contender BOX2D = {"Box2D 2.4", b2_maxPolygonVertices, create, run, destroy};
