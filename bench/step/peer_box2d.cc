// Box2D 2.4: 8 velocity and 3 position iterations, as its manual has it, or four and sixteen times
// as many; nothing sleeps.
#include "scene.h"

#include <box2d/box2d.h>
#include <vector>

namespace {

struct world {
    b2World w;
    float dt;
    int times; // as many iterations
    std::vector<b2Body *> bodies;
    world(const scene *s, int n) : w(b2Vec2(0.0f, float(-s->gravity))), dt(float(s->dt)), times(n)
    {
        w.SetAllowSleeping(false);
    }
};

void set_corners(b2PolygonShape *shape, const scene_polygon &p)
{
    b2Vec2 corners[b2_maxPolygonVertices];
    const int n = p.n < b2_maxPolygonVertices ? p.n : b2_maxPolygonVertices;
    for (int i = 0; i < n; i++) corners[i].Set(float(p.corners[i][0]), float(p.corners[i][1]));
    shape->Set(corners, n);
}

void add_shape(b2Body *body, const scene *s, int k)
{
    const scene_body &b = s->bodies[k];
    b2CircleShape circle;
    b2PolygonShape box;
    circle.m_radius = float(b.hx);
    if (b.shape == SHAPE_BOX) box.SetAsBox(float(b.hx), float(b.hy));
    if (b.shape == SHAPE_POLYGON) set_corners(&box, s->polygons[k]);
    b2FixtureDef f;
    f.shape = b.shape == SHAPE_DISC ? static_cast<b2Shape *>(&circle) : &box;
    f.density = 1.0f;
    f.friction = float(b.friction);
    f.restitution = float(b.restitution);
    body->CreateFixture(&f);
}

// Of the scene, not of a density: about the position.
void set_mass(b2Body *body, const scene_body &b)
{
    b2MassData m;
    m.mass = float(b.mass);
    m.center.SetZero();
    m.I = float(b.inertia);
    body->SetMassData(&m);
}

b2BodyType type_of(const scene_body &b)
{
    if (b.moves == SCENE_KINEMATIC) return b2_kinematicBody;
    return b.moves ? b2_dynamicBody : b2_staticBody;
}

void add_body(world *self, const scene *s, int k)
{
    const scene_body &b = s->bodies[k];
    b2BodyDef d;
    d.type = type_of(b);
    d.angle = float(b.q[0]);
    d.position.Set(float(b.q[1]), float(b.q[2]));
    d.angularVelocity = float(b.v[0]);
    d.linearVelocity.Set(float(b.v[1]), float(b.v[2]));
    b2Body *body = self->w.CreateBody(&d);
    if (b.shape != SHAPE_NONE) add_shape(body, s, k);
    if (b.moves == SCENE_DYNAMIC) set_mass(body, b);
    self->bodies.push_back(body);
}

template <int times> void *create(const scene *s)
{
    world *self = new world(s, times);
    for (int k = 0; k < s->n_bodies; k++) add_body(self, s, k);
    for (int k = 0; k < s->n_pins; k++) {
        const scene_pin &p = s->pins[k];
        b2RevoluteJointDef j;
        j.Initialize(self->bodies[size_t(p.a)], self->bodies[size_t(p.b)],
                     b2Vec2(float(p.x), float(p.y)));
        self->w.CreateJoint(&j);
    }
    return self;
}

void step(void *self, counters *c)
{
    world *s = static_cast<world *>(self);
    s->w.Step(s->dt, 8 * s->times, 3 * s->times);
    c->n_contacts = s->w.GetContactCount();
}

void place(void *self, int body, double q[3])
{
    const b2Body *b = static_cast<world *>(self)->bodies[size_t(body)];
    q[0] = double(b->GetAngle());
    q[1] = double(b->GetPosition().x);
    q[2] = double(b->GetPosition().y);
}

void speed(void *self, int body, double v[3])
{
    const b2Body *b = static_cast<world *>(self)->bodies[size_t(body)];
    v[0] = double(b->GetAngularVelocity());
    v[1] = double(b->GetLinearVelocity().x);
    v[2] = double(b->GetLinearVelocity().y);
}

void destroy(void *self)
{
    delete static_cast<world *>(self);
}

} // namespace

const contender BOX2D[3] = {{"Box2D 2.4", create<1>, step, place, destroy, speed},
                            {"Box2D 2.4 x4", create<4>, step, place, destroy, speed},
                            {"Box2D 2.4 x16", create<16>, step, place, destroy, speed}};
