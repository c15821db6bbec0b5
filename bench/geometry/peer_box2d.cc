// Box2D 2.4: b2CollidePolygons, from transforms with their rotation worked out; b2BroadPhase.
#include "pairs.h"
#include "piles.h"

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

struct tree {
    b2BroadPhase broadphase;
    std::vector<int32> proxies;
    int n_pairs;
    void AddPair(void *, void *)
    {
        n_pairs++;
    }
};

b2AABB aabb(const carom_box &b)
{
    b2AABB a;
    a.lowerBound.Set(float(b.lower.x), float(b.lower.y));
    a.upperBound.Set(float(b.upper.x), float(b.upper.y));
    return a;
}

void *tree_create(int n, const carom_box *boxes)
{
    tree *t = new tree;
    for (int i = 0; i < n; i++) {
        t->proxies.push_back(t->broadphase.CreateProxy(aabb(boxes[i]), nullptr));
    }
    return t;
}

int tree_step(void *self, int n, const carom_box *boxes)
{
    tree *t = static_cast<tree *>(self);
    t->n_pairs = 0;
    for (int i = 0; i < n; i++) {
        t->broadphase.MoveProxy(t->proxies[i], aabb(boxes[i]), b2Vec2(0.0f, 0.0f));
        t->broadphase.TouchProxy(t->proxies[i]); // every pair, as the others report
    }
    t->broadphase.UpdatePairs(t);
    return t->n_pairs;
}

void tree_destroy(void *self)
{
    delete static_cast<tree *>(self);
}

} // namespace

const finder BOX2D_TREE = {"Box2D 2.4", tree_create, tree_step, tree_destroy};
const contender BOX2D = {"Box2D 2.4", b2_maxPolygonVertices, create, run, destroy};
