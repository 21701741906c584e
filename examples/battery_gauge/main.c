/* The gauge beside a simulated cell, which it does not see but by noisy measurements. Answers 0 if the gauge is right. */
#include <math.h>
#include <stdio.h>

#include "gauge.h"

/* What must hold from the tenth minute on. */
#define CHARGE_BOUND 0.01
#define RESISTANCE_BOUND 0.002 /* ohm */
#define SETTLED 600
#define SECONDS (2 * 3600)

/* The cell: older than the gauge believes. */
typedef struct {
    double charge, pair;
} cell;

static const double capacity = 2.4 * 3600, resistance = 0.08, pair_resistance = 0.022, decay = 0.977;

static double terminal_voltage(const cell *cell, double current) {
    double z = cell->charge;
    return 3.2 + 1.6 * z - 2.0 * z * z + 1.4 * z * z * z - cell->pair - resistance * current;
}

static void discharge(cell *cell, double current) {
    cell->charge -= current / capacity;
    cell->pair = decay * cell->pair + (1 - decay) * pair_resistance * current;
}

/* Uniform in 0 ... 1, and about Gaussian with variance 1. */
static double uniform(void) {
    static uint32_t seed = 1;
    seed = seed * 1664525u + 1013904223u;
    return seed / 4294967296.0;
}

static double gaussian(void) {
    double sum = -6;
    for (int i = 0; i < 12; i++) {
        sum += uniform();
    }
    return sum;
}

int main(void) {
    cell cell = {0.9, 0};
    double current = 0, worst_charge = 0, worst_resistance = 0;
    gauge_reading reading = {0, 0, 0, 0};
    thetahat_error error = gauge_start((thetahat_number)0.6);
    for (int second = 0; second < SECONDS && !error; second++) {
        /* A new load every 20 seconds: at rest, up to 3 A, and at times it is charged. */
        if (second % 20 == 0) {
            current = uniform() < 0.25 ? 0 : 3.0 * uniform() - 0.6;
        }
        double measured_current = current + 0.01 + 0.02 * gaussian();
        double measured_voltage = terminal_voltage(&cell, current) + 0.005 * gaussian();
        /* One reading in fifty is lost. */
        error = gauge_step((thetahat_number)measured_current,
                           uniform() < 0.02 ? (thetahat_number)NAN : (thetahat_number)measured_voltage);
        discharge(&cell, current);
        if (!error) {
            error = gauge_read(&reading);
        }
        if (second >= SETTLED) {
            worst_charge = fmax(worst_charge, fabs(reading.charge - cell.charge));
            worst_resistance = fmax(worst_resistance, fabs(reading.resistance - resistance));
        }
    }
    if (error) {
        printf("%s: %s\n", thetahat_error_name(error), thetahat_error_text(error));
        return 1;
    }
    /* Whole numbers, as small C libraries print no others. */
    printf("charge: %d of 1000, gauge %d +- %d, off by at most %d\n", (int)lround(1000 * cell.charge),
           (int)lround(1000 * reading.charge), (int)lround(1000 * reading.charge_error),
           (int)lround(1000 * worst_charge));
    printf("resistance: %d mOhm, gauge %d +- %d, off by at most %d\n", (int)lround(1000 * resistance),
           (int)lround(1000 * reading.resistance), (int)ceil(1000 * reading.resistance_error),
           (int)lround(1000 * worst_resistance));
    return !(worst_charge < CHARGE_BOUND && worst_resistance < RESISTANCE_BOUND);
}
