/* A controller that learns its plant, a heater, while it runs, and asks for the power that brings the temperature to the set
   point in the next sample. */
#include <math.h>
#include <stdio.h>

#include "thetahat.h"

static thetahat_word memory[THETAHAT_ARX_WORDS(2)];
static thetahat_arx *heater;

/* y(k) + a1 y(k-1) = b1 u(k-1) + e(k): power in %, temperature rise in K. */
static thetahat_error start(void) {
    thetahat_arx_model model = {0};
    thetahat_learning learning = {0};
    model.na = 1;
    model.inputs = 1;
    model.input[0].nb = 1;
    model.input[0].nk = 1;
    model.output_scale = 20;
    model.input_scales[0] = 50;
    learning.forgetting = THETAHAT_FORGETTING_EXPONENTIAL;
    learning.factor = (thetahat_number)0.99;
    return thetahat_arx_init(&heater, memory, sizeof memory, &thetahat_arx_2, &model, &learning);
}

/* Measure, learn, compute, apply. NaN is a missing sample. */
static thetahat_error control(thetahat_number temperature, thetahat_number set_point, thetahat_number *power) {
    thetahat_number parameters[2];
    thetahat_error error = thetahat_arx_measured(heater, temperature, NULL);
    if (error) {
        return error;
    }
    thetahat_arx_parameters(heater, parameters, NULL, NULL);
    *power = (set_point + parameters[0] * temperature) / parameters[1];
    *power = isfinite(*power) ? fmin(fmax(*power, 0), 100) : 50;
    return thetahat_arx_applied(heater, power, 1);
}

int main(void) {
    thetahat_number temperature = 0, power = 0, parameters[2], errors[2];
    uint32_t seed = 1;
    thetahat_error error = start();
    for (int k = 0; k < 2000 && !error; k++) {
        seed = seed * 1664525u + 1013904223u;
        /* The plant, with a disturbance of 0.1 K. */
        temperature = (thetahat_number)(0.9 * temperature + 0.08 * power + 0.346 * (seed / 4294967295.0 - 0.5));
        error = control(temperature, k / 100 % 2 ? 35 : 30, &power);
    }
    if (!error) {
        error = thetahat_arx_parameters(heater, parameters, errors, NULL);
    }
    if (error) {
        printf("%s: %s\n", thetahat_error_name(error), thetahat_error_text(error));
        return 1;
    }
    /* Both are found, within three standard errors. */
    return !(fabs(parameters[0] + 0.9) < 3 * errors[0] && fabs(parameters[1] - 0.08) < 3 * errors[1]);
}
