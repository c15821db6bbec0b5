/* cmd.h: the subcommands, one file each. */
#ifndef CRM_CMD_H
#define CRM_CMD_H

#include "io/command.h"

extern const crm_command crm_command_run;
extern const crm_command crm_command_gradient;
extern const crm_command crm_command_explain;
extern const crm_command crm_command_validate;
extern const crm_command crm_command_contact;
extern const crm_command crm_command_lcp;
extern const crm_command crm_command_send;
extern const crm_command crm_command_watch;

#endif
