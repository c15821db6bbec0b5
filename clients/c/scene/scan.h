/* scan.h: duplicate keys in a JSON text, each with its place. */
#ifndef CRM_SCENE_SCAN_H
#define CRM_SCENE_SCAN_H

#include "json.h"

/* Notes a fault for every key that stands twice in one object of `text`, a valid JSON text ending
 * in a zero byte.  Returns how many.  Keys are compared as written: escapes are not resolved. */
int crm_scan_duplicates(const char *text, crm_problems *problems);

#endif
