/* profile.h: instructions and functions of a run, counted by valgrind's callgrind. */
#ifndef BENCH_LEAVE_OUT_PROFILE_H
#define BENCH_LEAVE_OUT_PROFILE_H

/* Functions of the libraries, by nm; and those that a run entered. */
typedef struct names {
    int n, max;
    char (*list)[64];
} names;

typedef struct profile {
    double instructions;
    names entered; /* of the libraries */
    int ccd, amd;  /* 1: libccd, SuiteSparse's AMD were entered too */
} profile;

/* Functions that are defined in the archives, whose paths are separated by colons; sorted.
 * n = 0: there is no nm. */
names library_functions(const char *archives);
int names_have(const names *all, const char *name);
void names_free(names *all);
/* Of the program `command`; instructions < 0: there is no valgrind. */
profile profile_of(const char *command, const names *library);

#endif
