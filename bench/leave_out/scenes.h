/* scenes.h: twenty scenes, each as it is and once more with what it leaves out kept alive. */
#ifndef BENCH_LEAVE_OUT_SCENES_H
#define BENCH_LEAVE_OUT_SCENES_H

#include "carom/carom.h"

typedef struct case_scene {
    const char *name;
    const char *kept; /* what the second form keeps, though the motion needs none of it */
    /* kept = 0: as it is.  The world is sealed; a failure ends the program. */
    carom_world *(*build)(int kept);
    int taped; /* 1: the second form is recorded on a tape */
    int n_steps;
} case_scene;

extern const case_scene CASES[];
extern const int N_CASES;

#endif
