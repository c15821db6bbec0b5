/* udpm.h: can LCM's UDP multicast work on this machine?  LCM itself only says that it failed. */
#ifndef CRM_UDPM_H
#define CRM_UDPM_H

enum { CRM_UDPM_TEXT = 512 };

typedef enum crm_udpm_answer {
    CRM_UDPM_NO,   /* text: why, and the commands that repair it */
    CRM_UDPM_YES,  /* text: "" */
    CRM_UDPM_LOSSY /* text: buffers are small, and the commands that enlarge them */
} crm_udpm_answer;

/* url: "udpm://ADDRESS:PORT?recv_buf_size=BYTES...", each part may be missing. */
crm_udpm_answer crm_udpm_check(const char *url, char text[CRM_UDPM_TEXT]);

#endif
