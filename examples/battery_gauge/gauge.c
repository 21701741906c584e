#include "gauge.h"

#include <math.h>

#define NUMBER(x) ((thetahat_number)(x))

/* The cell, as its maker and some tests tell: capacity in ampere seconds, and a pair of resistance and capacitance. */
#define CAPACITY NUMBER(2.5 * 3600)
#define PAIR_RESISTANCE NUMBER(0.02)
#define PAIR_DECAY NUMBER(0.975) /* exp(-1 s/40 s) */

/* What is not known of it: standard deviations. */
#define CHARGE_GUESS NUMBER(0.3)
#define PAIR_GUESS NUMBER(0.01)
#define RESISTANCE NUMBER(0.05)
#define RESISTANCE_GUESS NUMBER(0.05)
#define CHARGE_DRIFT NUMBER(2e-5)     /* a second: the current is not measured exactly */
#define PAIR_DRIFT NUMBER(5e-4)       /* V */
#define RESISTANCE_DRIFT NUMBER(1e-5) /* ohm: it ages, and depends on the temperature */
#define VOLTAGE_NOISE NUMBER(0.01)    /* V: that of the meter, and of the curve of the open circuit */

/* States: charge, voltage of the pair, resistance. */
enum { CHARGE, PAIR, OHMIC, STATES };

static thetahat_word memory[THETAHAT_EKF_WORDS(STATES, 1)];
static thetahat_ekf *filter;

/* The voltage of the open circuit, and its slope. */
static thetahat_number open_circuit(thetahat_number z) {
    return NUMBER(3.2) + z * (NUMBER(1.6) + z * (NUMBER(-2.0) + z * NUMBER(1.4)));
}

static thetahat_number open_circuit_slope(thetahat_number z) {
    return NUMBER(1.6) + z * (NUMBER(-4.0) + z * NUMBER(4.2));
}

/* Charge is counted, the pair relaxes, the resistance stays. The context is the current. */
static void next(const thetahat_number *x, thetahat_number *next, void *context) {
    thetahat_number current = *(const thetahat_number *)context;
    next[CHARGE] = x[CHARGE] - current / CAPACITY;
    next[PAIR] = PAIR_DECAY * x[PAIR] + (1 - PAIR_DECAY) * PAIR_RESISTANCE * current;
    next[OHMIC] = x[OHMIC];
}

/* Entries that are not written are 0. */
static void next_jacobian(const thetahat_number *x, thetahat_number *jacobian, void *context) {
    (void)x;
    (void)context;
    jacobian[STATES * CHARGE + CHARGE] = 1;
    jacobian[STATES * PAIR + PAIR] = PAIR_DECAY;
    jacobian[STATES * OHMIC + OHMIC] = 1;
}

static void voltage(const thetahat_number *x, thetahat_number *voltage, void *context) {
    thetahat_number current = *(const thetahat_number *)context;
    voltage[0] = open_circuit(x[CHARGE]) - x[PAIR] - x[OHMIC] * current;
}

static void voltage_jacobian(const thetahat_number *x, thetahat_number *jacobian, void *context) {
    thetahat_number current = *(const thetahat_number *)context;
    jacobian[CHARGE] = open_circuit_slope(x[CHARGE]);
    jacobian[PAIR] = -1;
    jacobian[OHMIC] = -current;
}

/* A diagonal matrix of variances. */
static void variances(thetahat_number *matrix, thetahat_number charge, thetahat_number pair, thetahat_number ohmic) {
    for (int entry = 0; entry < STATES * STATES; entry++) {
        matrix[entry] = 0;
    }
    matrix[STATES * CHARGE + CHARGE] = charge * charge;
    matrix[STATES * PAIR + PAIR] = pair * pair;
    matrix[STATES * OHMIC + OHMIC] = ohmic * ohmic;
}

thetahat_error gauge_start(thetahat_number charge) {
    const thetahat_number state[STATES] = {charge, 0, RESISTANCE};
    const thetahat_number noise[1] = {VOLTAGE_NOISE * VOLTAGE_NOISE};
    thetahat_number prior[STATES * STATES], drift[STATES * STATES];
    thetahat_error error;
    variances(prior, CHARGE_GUESS, PAIR_GUESS, RESISTANCE_GUESS);
    variances(drift, CHARGE_DRIFT, PAIR_DRIFT, RESISTANCE_DRIFT);
    error = thetahat_ekf_init(&filter, memory, sizeof memory, &thetahat_ekf_3_1, state, prior);
    return error ? error : thetahat_ekf_set_noise(filter, drift, noise);
}

thetahat_error gauge_step(thetahat_number current, thetahat_number measured) {
    const thetahat_function observation = {voltage, voltage_jacobian, &current};
    const thetahat_function transition = {next, next_jacobian, &current};
    thetahat_error error = thetahat_ekf_correct(filter, &observation, &measured, NULL);
    return error ? error : thetahat_ekf_predict(filter, &transition);
}

thetahat_error gauge_read(gauge_reading *reading) {
    thetahat_number state[STATES], covariance[STATES * STATES];
    thetahat_error error = thetahat_ekf_state(filter, state);
    if (!error) {
        error = thetahat_ekf_covariance(filter, covariance);
    }
    if (!error) {
        reading->charge = state[CHARGE];
        reading->resistance = state[OHMIC];
        reading->charge_error = NUMBER(sqrt(covariance[STATES * CHARGE + CHARGE]));
        reading->resistance_error = NUMBER(sqrt(covariance[STATES * OHMIC + OHMIC]));
    }
    return error;
}
