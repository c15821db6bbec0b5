/* options.h: the command line of caromd. */
#ifndef CRM_OPTIONS_H
#define CRM_OPTIONS_H

#include "daemon.h"

typedef struct crm_options {
    crm_daemon_settings daemon;
    int help;
    int version;
} crm_options;

/* 1: *options is filled, with defaults for what is not given.  0: `text` (CRM_DAEMON_TEXT bytes)
 * says what is wrong. */
int crm_options_parse(int argc, char **argv, crm_options *options, char *text);
/* The help text, to be freed; NULL: no memory. */
char *crm_options_help(void);

#endif
