/* Steps every kind of object through a record, and prints the bits of what it answers: `name k bits bits ...`. tests/steps.rs
   does the same in Rust. */
#include <math.h>
#include <string.h>

#include "done.h"

/* How many samples it has, and which output is missing. */
#define SAMPLES 120
#define MISSING 60

typedef struct {
    thetahat_number u; /* random, 1 or -1 */
    thetahat_number y; /* of a first-order plant, with noise */
} sample;

/* Whole numbers over 1024: the same in single and in double precision. At sample 80 something hits the plant. */
static void make_record(sample record[SAMPLES]) {
    uint32_t seed = 1;
    int32_t u = 0, y = 0;
    for (int k = 0; k < SAMPLES; k++) {
        seed = seed * 1664525u + 1013904223u;
        y = 3 * y / 4 + u / 2 + (int32_t)(seed >> 8 & 63) - 32;
        u = seed >> 31 ? 1024 : -1024;
        y += k == 80 ? 1024 : 0;
        record[k].u = (thetahat_number)u / 1024;
        record[k].y = k == MISSING ? (thetahat_number)NAN : (thetahat_number)y / 1024;
    }
}

static void print_numbers(const thetahat_number *numbers, int count) {
    for (int i = 0; i < count; i++) {
        uint64_t wide = 0;
        uint32_t narrow = 0;
        if (isnan(numbers[i])) {
            printf(" nan");
        } else if (sizeof numbers[i] == sizeof wide) {
            memcpy(&wide, &numbers[i], sizeof numbers[i]);
            printf(" %08lx%08lx", (unsigned long)(wide >> 32), (unsigned long)(wide & 0xffffffffu));
        } else {
            memcpy(&narrow, &numbers[i], sizeof numbers[i]);
            printf(" %08lx", (unsigned long)narrow);
        }
    }
}

static void print_innovation(const thetahat_innovation *innovation) {
    print_numbers(innovation->error, (int)innovation->outputs);
    print_numbers(innovation->variance, (int)innovation->outputs);
    print_numbers(&innovation->nis, 1);
    printf(" %s", thetahat_action_word(innovation->action));
}

static sample record[SAMPLES];

/* What was k samples before, or 0. */
static sample before(int k, int lag) {
    static const sample none = {0, 0};
    return k < lag ? none : record[k - lag];
}

static void step_rls(void) {
    static thetahat_word memory[THETAHAT_RLS_WORDS(4)];
    const thetahat_number scales[4] = {1, 1, 1, 1};
    thetahat_learning learning = {0};
    thetahat_rls *rls;
    learning.forgetting = THETAHAT_FORGETTING_EXPONENTIAL;
    learning.factor = (thetahat_number)0.96875;
    learning.outliers = THETAHAT_OUTLIERS_HUBER;
    learning.threshold = 1;
    done("rls", thetahat_rls_init(&rls, memory, sizeof memory, &thetahat_rls_4, scales, &learning));
    for (int k = 0; k < SAMPLES; k++) {
        thetahat_number regressor[4] = {-before(k, 1).y, -before(k, 2).y, before(k, 1).u, before(k, 2).u};
        thetahat_number parameters[4], errors[4], variance, covariance[16];
        thetahat_innovation innovation;
        done("rls", thetahat_rls_update(rls, regressor, record[k].y, &innovation));
        done("rls", thetahat_rls_parameters(rls, parameters, errors, &variance));
        done("rls", thetahat_rls_covariance(rls, covariance));
        printf("rls %d", k);
        print_innovation(&innovation);
        print_numbers(parameters, 4);
        print_numbers(errors, 4);
        print_numbers(&variance, 1);
        print_numbers(covariance, 16);
        printf("\n");
    }
}

/* What a fit of so many parameters, up to 5, knows. */
static void set_fit(const char *name, thetahat_arx *arx, size_t count) {
    const thetahat_number quarter = (thetahat_number)0.25;
    const thetahat_number parameters[5] = {(thetahat_number)-0.5, -quarter / 2, quarter / 2, quarter, -quarter};
    thetahat_number factor[25];
    for (size_t row = 0; row < count; row++) {
        for (size_t column = 0; column < count; column++) {
            factor[row * count + column] = row == column ? quarter / 16 : row < column ? quarter : 0;
        }
    }
    done(name, thetahat_arx_set_fit(arx, parameters, factor, quarter / 16, 50));
}

/* The same model twice, as ARX and with one c more as ARMAX, from nothing or from a fit; a detector watches it. */
static void step_arx(const char *name, const thetahat_arx_size *size, uint32_t nc, int warm) {
    static thetahat_word memory[THETAHAT_ARMAX_WORDS(5)], detector_memory[THETAHAT_DETECTOR_WORDS];
    thetahat_arx_model model = {0};
    thetahat_learning learning = {0};
    thetahat_arx *arx;
    thetahat_detector *detector;
    model.na = 2;
    model.inputs = 1;
    model.input[0].nb = 2;
    model.input[0].nk = 1;
    model.nc = nc;
    model.output_scale = 1;
    model.input_scales[0] = 1;
    model.noise_scale = (thetahat_number)0.125;
    learning.forgetting = THETAHAT_FORGETTING_EXPONENTIAL;
    learning.factor = (thetahat_number)0.99; /* as without it */
    learning.outliers = THETAHAT_OUTLIERS_GATE;
    learning.threshold = 2;
    learning.release = 1;
    done(name, thetahat_arx_init(&arx, memory, sizeof memory, size, &model, warm ? &learning : NULL));
    if (warm) {
        set_fit(name, arx, 4 + nc);
    }
    done(name, thetahat_detector_init(&detector, detector_memory, sizeof detector_memory, 2, 3));
    for (int k = 0; k < SAMPLES; k++) {
        thetahat_number parameters[5], ahead[3];
        const thetahat_number future[3] = {1, 0, -1};
        thetahat_innovation innovation;
        thetahat_alarm alarm;
        done(name, thetahat_arx_measured(arx, record[k].y, &innovation));
        done(name, thetahat_arx_predict(arx, future, 3, ahead, 3));
        done(name, thetahat_arx_applied(arx, &record[k].u, 1));
        done(name, thetahat_arx_parameters(arx, parameters, NULL, NULL));
        done(name, thetahat_detector_update(detector, &innovation, &alarm));
        printf("%s %d", name, k);
        print_innovation(&innovation);
        print_numbers(parameters, (int)(4 + nc));
        print_numbers(ahead, 3);
        print_numbers(&alarm.statistic, 1);
        printf(" %d %lu\n", (int)alarm.chart, (unsigned long)alarm.samples);
    }
}

/* Position and rate. */
static const thetahat_number state_matrix[4] = {1, (thetahat_number)0.125, (thetahat_number)-0.25, (thetahat_number)0.75};
static const thetahat_number input_matrix[2] = {0, (thetahat_number)0.5};
static const thetahat_number zeros[2] = {0, 0};

static void step_kalman(void) {
    static thetahat_word memory[THETAHAT_KALMAN_WORDS(2, 2)];
    const thetahat_number prior[4] = {4, 1, 1, 2}, process_noise[4] = {(thetahat_number)0.25, 0, 0, (thetahat_number)0.5};
    const thetahat_number outputs[4] = {1, 0, 1, (thetahat_number)0.5}, noise[4] = {(thetahat_number)0.5, 0, 0, 1};
    thetahat_kalman *kalman;
    done("kalman", thetahat_kalman_init(&kalman, memory, sizeof memory, &thetahat_kalman_2_2, zeros, prior));
    done("kalman", thetahat_kalman_set_transition(kalman, state_matrix, input_matrix, 1, process_noise));
    done("kalman", thetahat_kalman_set_observation(kalman, outputs, NULL, noise));
    done("kalman", thetahat_kalman_set_gate(kalman, 2, 2));
    for (int k = 0; k < SAMPLES; k++) {
        thetahat_number measurement[2] = {record[k].y, before(k, 1).y}, state[2], covariance[4];
        thetahat_innovation innovation;
        if (k == 5) {
            done("kalman", thetahat_kalman_set_state(kalman, record[k].y > 0 ? measurement : zeros));
            done("kalman", thetahat_kalman_widen(kalman, 4));
        }
        done("kalman", thetahat_kalman_correct(kalman, &record[k].u, measurement, &innovation));
        done("kalman", thetahat_kalman_predict(kalman, &record[k].u));
        done("kalman", thetahat_kalman_state(kalman, state));
        done("kalman", thetahat_kalman_covariance(kalman, covariance));
        printf("kalman %d", k);
        print_innovation(&innovation);
        print_numbers(state, 2);
        print_numbers(covariance, 4);
        printf("\n");
    }
}

/* A spring that hardens, pushed by u; the context is the push. */
static void spring_next(const thetahat_number *x, thetahat_number *next, void *context) {
    const thetahat_number *u = (const thetahat_number *)context;
    next[0] = x[0] + x[1] / 8;
    next[1] = x[1] + (*u - x[1] - x[0] - x[0] * x[0] * x[0]) / 8;
}

static void spring_jacobian(const thetahat_number *x, thetahat_number *jacobian, void *context) {
    (void)context;
    jacobian[0] = 1;
    jacobian[1] = (thetahat_number)0.125;
    jacobian[2] = -(1 + 3 * x[0] * x[0]) / 8;
    jacobian[3] = (thetahat_number)0.875;
}

/* The gauge bends too. */
static void gauge(const thetahat_number *x, thetahat_number *output, void *context) {
    (void)context;
    output[0] = x[0] + x[0] * x[0] / 8;
}

static void gauge_jacobian(const thetahat_number *x, thetahat_number *jacobian, void *context) {
    (void)context;
    jacobian[0] = 1 + x[0] / 4;
}

static void step_ekf(void) {
    static thetahat_word memory[THETAHAT_EKF_WORDS(2, 1)];
    const thetahat_number prior[4] = {4, 1, 1, 2}, process_noise[4] = {(thetahat_number)0.25, 0, 0, (thetahat_number)0.5};
    const thetahat_number noise[1] = {(thetahat_number)0.5};
    thetahat_number u;
    thetahat_function transition = {spring_next, spring_jacobian, NULL};
    const thetahat_function observation = {gauge, gauge_jacobian, NULL};
    thetahat_ekf *ekf;
    transition.context = &u;
    done("ekf", thetahat_ekf_init(&ekf, memory, sizeof memory, &thetahat_ekf_2_1, zeros, prior));
    done("ekf", thetahat_ekf_set_noise(ekf, process_noise, noise));
    done("ekf", thetahat_ekf_set_iterations(ekf, 2));
    for (int k = 0; k < SAMPLES; k++) {
        thetahat_number state[2], covariance[4];
        thetahat_innovation innovation;
        u = record[k].u;
        done("ekf", thetahat_ekf_correct(ekf, &observation, &record[k].y, &innovation));
        done("ekf", thetahat_ekf_predict(ekf, &transition));
        done("ekf", thetahat_ekf_state(ekf, state));
        done("ekf", thetahat_ekf_covariance(ekf, covariance));
        printf("ekf %d", k);
        print_innovation(&innovation);
        print_numbers(state, 2);
        print_numbers(covariance, 4);
        printf("\n");
    }
}

static void step_ukf(void) {
    static thetahat_word memory[THETAHAT_UKF_WORDS(2, 1)];
    const thetahat_number prior[4] = {4, 1, 1, 2}, process_noise[4] = {(thetahat_number)0.25, 0, 0, (thetahat_number)0.5};
    const thetahat_number noise[1] = {(thetahat_number)0.5};
    thetahat_number u;
    thetahat_function transition = {spring_next, NULL, NULL};
    const thetahat_function observation = {gauge, NULL, NULL};
    thetahat_ukf *ukf;
    transition.context = &u;
    done("ukf", thetahat_ukf_init(&ukf, memory, sizeof memory, &thetahat_ukf_2_1, zeros, prior));
    done("ukf", thetahat_ukf_set_noise(ukf, process_noise, noise));
    done("ukf", thetahat_ukf_set_spread(ukf, (thetahat_number)1.5));
    for (int k = 0; k < SAMPLES; k++) {
        thetahat_number state[2], covariance[4];
        thetahat_innovation innovation;
        u = record[k].u;
        done("ukf", thetahat_ukf_correct(ukf, &observation, &record[k].y, &innovation));
        done("ukf", thetahat_ukf_predict(ukf, &transition));
        done("ukf", thetahat_ukf_state(ukf, state));
        done("ukf", thetahat_ukf_covariance(ukf, covariance));
        printf("ukf %d", k);
        print_innovation(&innovation);
        print_numbers(state, 2);
        print_numbers(covariance, 4);
        printf("\n");
    }
}

static void step_luenberger(void) {
    static thetahat_word memory[THETAHAT_LUENBERGER_WORDS(2, 1)];
    const thetahat_number outputs[2] = {1, 0}, real[2] = {(thetahat_number)0.25, (thetahat_number)0.25};
    const thetahat_number imaginary[2] = {(thetahat_number)0.125, (thetahat_number)-0.125};
    thetahat_number gain[2];
    thetahat_luenberger *observer;
    done("luenberger",
         thetahat_luenberger_init(&observer, memory, sizeof memory, &thetahat_luenberger_2_1, zeros, NULL));
    done("luenberger", thetahat_luenberger_set_transition(observer, state_matrix, input_matrix, 1));
    done("luenberger", thetahat_luenberger_set_observation(observer, outputs, NULL));
    done("luenberger", thetahat_luenberger_place(observer, real, imaginary, NULL));
    done("luenberger", thetahat_luenberger_gain(observer, gain));
    for (int k = 0; k < SAMPLES; k++) {
        thetahat_number state[2];
        thetahat_innovation innovation;
        done("luenberger", thetahat_luenberger_update(observer, &record[k].u, &record[k].y, &innovation));
        done("luenberger", thetahat_luenberger_state(observer, state));
        printf("luenberger %d", k);
        print_innovation(&innovation);
        print_numbers(gain, 2);
        print_numbers(state, 2);
        printf("\n");
    }
}

static void step_rst(void) {
    static thetahat_word memory[THETAHAT_RST_WORDS(2)];
    const thetahat_number a[2] = {1, (thetahat_number)-0.75}, b[2] = {0, (thetahat_number)0.5};
    const thetahat_number response[2] = {1, (thetahat_number)-0.5}, forgotten[2] = {1, (thetahat_number)-0.25};
    thetahat_rst_poles poles;
    thetahat_rst_law law;
    thetahat_number input;
    thetahat_rst *rst;
    poles.response = response;
    poles.response_count = 2;
    poles.observer = forgotten;
    poles.observer_count = 2;
    poles.integrator = 1;
    poles.cancel_zeros = 0;
    done("rst", thetahat_rst_place(&thetahat_rst_place_2, a, 2, b, 2, &poles, &law));
    done("rst", thetahat_rst_init(&rst, memory, sizeof memory, &thetahat_rst_2, &law));
    done("rst", thetahat_rst_set_limits(rst, -1, 1));
    done("rst", thetahat_rst_start(rst, (thetahat_number)0.5, record[0].y, record[0].u));
    for (int k = 0; k < SAMPLES; k++) {
        done("rst", thetahat_rst_control(rst, record[k].u, record[k].y, &input));
        done("rst", thetahat_rst_applied(rst, input / 2));
        printf("rst %d", k);
        print_numbers(&input, 1);
        print_numbers(law.r, 2);
        print_numbers(law.s, 2);
        printf("\n");
    }
}

/* In a closed loop with a plant of first order; the noise is that of the record. */
static void step_tuner(const char *name, const thetahat_tuner_size *size, int parameters) {
    // Enough for either.
    static thetahat_word memory[THETAHAT_INDIRECT_WORDS(1, 1) + THETAHAT_DIRECT_WORDS(1, 1, 1)];
    thetahat_number input = 0, output = 0, found[3];
    thetahat_tuner_wish wish;
    thetahat_tuner *tuner;
    int32_t state;
    done(name, thetahat_tuner_usual(&wish, 1, 1, -4, 4));
    wish.frequency = (thetahat_number)0.5;
    done(name, thetahat_tuner_init(&tuner, memory, sizeof memory, size, &wish, NULL));
    for (int k = 0; k < SAMPLES; k++) {
        output = (thetahat_number)0.75 * output + input / 2;
        done(name, thetahat_tuner_control(tuner, record[k].u, output + record[k].y / 64, &input));
        done(name, thetahat_tuner_read(tuner, &state, found));
        printf("%s %d", name, k);
        print_numbers(&input, 1);
        print_numbers(found, parameters);
        printf(" %d\n", (int)state);
    }
}

int main(void) {
    if (thetahat_number_bytes() != sizeof(thetahat_number)) {
        printf("the library has another precision\n");
        return 1;
    }
    make_record(record);
    step_rls();
    step_arx("arx", &thetahat_arx_4, 0, 0);
    step_arx("arx_warm", &thetahat_arx_4, 0, 1);
    step_arx("armax", &thetahat_armax_5, 1, 0);
    step_arx("armax_warm", &thetahat_armax_5, 1, 1);
    step_kalman();
    step_ekf();
    step_ukf();
    step_luenberger();
    step_rst();
    step_tuner("indirect", &thetahat_indirect_1_1, 3);
    step_tuner("direct", &thetahat_direct_1_1_1, 3);
    return 0;
}
