/* fdiff.h: central differences with one Richardson step, error O(h^4), and an estimate of it. */
#ifndef SUPPORT_FDIFF_H
#define SUPPORT_FDIFF_H

/* d f(t) / dt at 0.  h: largest |t| tried.  error, may be NULL: |D(h, h/2) - D(h/2)|, which bounds
 * the error of a smooth f well and is large where f has a kink. */
double fdiff(double (*f)(double t, void *user), void *user, double h, double *error);

/* Derivative of f with respect to *entry, which is moved by up to h and put back bit for bit. */
double fdiff_entry(double (*f)(void *user), void *user, double *entry, double h, double *error);

#endif
