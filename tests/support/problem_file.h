/* problem_file.h: the contact problems of tests/data/lcp (docs of the format: SCENE, "Problem
 * files"): M v - J_c' lam_n - J_t' lam_t - J_e' lam_e + q = 0. */
#ifndef SUPPORT_PROBLEM_FILE_H
#define SUPPORT_PROBLEM_FILE_H

/* A list of entries (i[k], j[k], x[k]). */
typedef struct problem_triplets {
    int n_rows;
    int n_cols;
    int n;
    int *i;
    int *j;
    double *x;
} problem_triplets;

typedef struct problem_file {
    char name[128];
    char family[32];
    int feasible;  /* status "ok"; else "infeasible_LP" */
    int compare_v; /* the reference v is the only solution known */
    double spread; /* of v [m/s] */
    int n_bodies;
    int n_contacts;
    int n_joint_rows;
    double *M; /* 3 n_bodies: the diagonal */
    double *q; /* 3 n_bodies */
    double *mu;
    double *c;
    double *v; /* 3 n_bodies: reference */
    problem_triplets jc;
    problem_triplets jt;
    problem_triplets je;
} problem_file;

/* 0 when the file reads and its sizes agree; otherwise -1 and *p is empty. */
int problem_file_read(const char *path, problem_file *p);
void problem_file_free(problem_file *p);

/* Calls visit for each *.json of the folder in the order of names; returns how many, -1 when the
 * folder or one of its files does not read. */
int problem_file_each(const char *folder, void (*visit)(const problem_file *p, void *user),
                      void *user);

#endif
