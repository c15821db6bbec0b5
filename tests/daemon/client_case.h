/* client_case.h: what tests of the client library do to a server, whatever is between them. */
#ifndef TEST_DAEMON_CLIENT_CASE_H
#define TEST_DAEMON_CLIENT_CASE_H

#include "carom/client.h"

enum { CASE_BODIES = 4, CASE_STEPS = 60 };

/* A floor, two discs in a box's way and a link: views of static data. */
carom_client_scene case_scene(void);

/* Poses after each step, by stepping the library directly. */
void case_direct(double q[CASE_STEPS][3 * CASE_BODIES]);
/* The same through the client, in requests of `per_request` steps.  Returns the code of the first
 * call that failed. */
carom_client_code case_through(carom_client *client, int per_request,
                               double q[CASE_STEPS][3 * CASE_BODIES]);

/* Opens the case, records it, asks for gradients, descends: fails the test when an answer differs
 * from the library's. */
void case_gradient(carom_client *client);
/* Snapshots, reset, replaced scene, refused requests. */
void case_session(carom_client *client);
/* Scene files: good, with force tables, wrong, missing. */
void case_file(carom_client *client);
/* A scene above 60 KB. */
void case_large(carom_client *client);

#endif
