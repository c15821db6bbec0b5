/* loss.h: a loss file: terms of the states of a run. */
#ifndef CRM_LOSS_H
#define CRM_LOSS_H

#include "carom/grad.h"
#include "clients/c/scene/scene.h"

typedef struct crm_term {
    long step;       /* 0 ... steps of the run */
    int coordinate;  /* 3 body + component, of q or of v */
    int of_velocity; /* 1: of v */
    double weight;
    double target;
    int squared; /* weight (value - target)^2, else weight * value */
} crm_term;

typedef struct crm_loss {
    int count;
    crm_term *terms; /* steps ascending */
} crm_loss;

/* Reads problems->file for a run of n_steps; 1, or 0 with the faults noted.  Free in any case. */
int crm_loss_read(crm_problems *problems, const crm_scene *scene, long n_steps, crm_loss *loss);
void crm_loss_free(crm_loss *loss);

/* Sum of the terms of one step. */
double crm_loss_at(const crm_loss *loss, long step, const double *q, const double *v);

/* Cotangents of a run whose states are on the tape: one bar per step that has a term. */
typedef struct crm_loss_bars {
    int count;
    carom_state_bar *bars;
    double *numbers; /* owns q and v of the bars */
} crm_loss_bars;

crm_loss_bars crm_loss_cotangents(const crm_loss *loss, const carom_tape *tape, int n_bodies);
void crm_loss_bars_free(crm_loss_bars *bars);

#endif
