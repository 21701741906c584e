/* A battery gauge: how full a cell is, and how large its inner resistance has become. */
#ifndef GAUGE_H
#define GAUGE_H

#include "thetahat.h"

typedef struct {
    thetahat_number charge;           /* state of charge, 0 ... 1 */
    thetahat_number resistance;       /* inner resistance in ohm */
    thetahat_number charge_error;     /* the standard errors of both */
    thetahat_number resistance_error;
} gauge_reading;

/* Starts from a guess of the state of charge, 0 ... 1, that may be off by 0.3. */
thetahat_error gauge_start(thetahat_number charge);

/* One second: the current in ampere, positive where it discharges, and the voltage in volt, NaN where it is missing. */
thetahat_error gauge_step(thetahat_number current, thetahat_number voltage);

thetahat_error gauge_read(gauge_reading *reading);

#endif
