/* What the programs beside it have in common. */
#ifndef DONE_H
#define DONE_H

#include <stdio.h>
#include <stdlib.h>

#include "thetahat.h"

/* Ends the program if a call failed. */
static void done(const char *name, int32_t code) {
    if (code != THETAHAT_ERROR_NONE) {
        printf("%s: %s, %s\n", name, thetahat_error_name(code), thetahat_error_text(code));
        exit(1);
    }
}

#endif
