/* gradient_scenes.h: runs whose derivatives are checked: impacts, friction that sticks and slips,
 * stacks, chains, every joint with its limits, springs and motors. */
#ifndef SUPPORT_GRADIENT_SCENES_H
#define SUPPORT_GRADIENT_SCENES_H

#include "carom/world.h"

typedef struct gradient_scene gradient_scene;
struct gradient_scene {
    const char *name;
    carom_world *(*build)(const gradient_scene *s); /* with scene_integrator and scene_order */
    int n_steps;
    double step; /* of differences */
    int joint;   /* of a joint scene: which */
};

extern const gradient_scene gradient_scenes[];
extern const int n_gradient_scenes;
/* Two bodies and a joint, hit by a ball. */
extern const gradient_scene gradient_joint_scenes[];
extern const int n_gradient_joint_scenes;

#endif
