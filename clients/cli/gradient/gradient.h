/* gradient.h: the loss of a run and its gradient, as `carom gradient` reports them. */
#ifndef CRM_GRADIENT_H
#define CRM_GRADIENT_H

#include "carom/grad.h"
#include "gradient/loss.h"
#include "io/load.h"

typedef enum crm_wrt {
    CRM_Q0,
    CRM_V0,
    CRM_MASS,
    CRM_INERTIA,
    CRM_FRICTION,
    CRM_RESTITUTION,
    CRM_GRAVITY,
    CRM_RADIUS,
    CRM_VERTICES,
    CRM_ANCHORS,
    CRM_FORCE,
    CRM_DT,
    CRM_N_WRT
} crm_wrt;

/* "q0", "v0", ...; NULL at the end. */
extern const char *const crm_wrt_names[CRM_N_WRT + 1];

typedef struct crm_gradient {
    double loss;
    int degenerate;
    double smoothing; /* kappa of carom_tape_smooth; 0: none */
    long unsmoothed;
    int name_kinks; /* 1: fill kinks */
    int n_kinks;
    carom_kink *kinks;
    double seconds_forward;
    double seconds_backward;
    int wanted[CRM_N_WRT];
    int count[CRM_N_WRT];
    double *
        x[CRM_N_WRT]; /* all arrays, wanted or not; radius per shape, vertices and anchors (x, y) */
} crm_gradient;

/* Sizes of the arrays; nothing wanted yet. */
void crm_gradient_prepare(crm_gradient *g, const crm_scene *scene);
void crm_gradient_free(crm_gradient *g);

/* Runs the scene on a tape and back.  CRM_DONE, or CRM_FAILED with a message. */
int crm_gradient_compute(crm_gradient *g, const crm_run *run, const crm_loss *loss, int quiet);

#endif
