/* thetahat in C. Made by cbindgen from crates/thetahat-c: do not edit. */

#ifndef THETAHAT_H
#define THETAHAT_H

#include <stddef.h>
#include <stdint.h>

// How many words of memory an object needs, n being the number of parameters, coefficients or states, and m that of outputs:
// static thetahat_word memory[THETAHAT_RLS_WORDS(4)];
#define THETAHAT_WORDS(numbers, bytes) \
    (((numbers) * sizeof(thetahat_number) + (bytes) + sizeof(thetahat_word) - 1) / sizeof(thetahat_word))
#define THETAHAT_RLS_WORDS(n) THETAHAT_WORDS((n) * (n) + 3 * (n) + 9, 56 + (n))
#define THETAHAT_ARX_WORDS(n) THETAHAT_WORDS((n) * (n) + 4 * (n) + 25, 80 + 7 * (n))
#define THETAHAT_ARMAX_WORDS(n) THETAHAT_WORDS(2 * (n) * (n) + 4 * (n) + 26, 96 + 7 * (n))
#define THETAHAT_KALMAN_WORDS(n, m) THETAHAT_WORDS((n) * (4 * (n) + (m) + 5) + (m) * ((m) + 4) + 1, 56)
#define THETAHAT_EKF_WORDS(n, m) THETAHAT_WORDS((n) * (2 * (n) + 1) + (m) * (m) + 1, 40)
#define THETAHAT_UKF_WORDS(n, m) THETAHAT_WORDS((n) * (2 * (n) + 1) + (m) * (m) + 2, 32)
#define THETAHAT_LUENBERGER_WORDS(n, m) THETAHAT_WORDS((n) * (3 * (n) + 2 * (m) + 5) + (m) * ((m) + 4), 48)
#define THETAHAT_RST_WORDS(n) THETAHAT_WORDS(4 * (n) + 4, 16)
#define THETAHAT_INDIRECT_WORDS(na, nb) \
    THETAHAT_WORDS(((na) + (nb)) * ((na) + (nb) + 18) + 62, 7 * ((na) + (nb)) + 242)
#define THETAHAT_DIRECT_WORDS(na, nb, delay) \
    THETAHAT_WORDS(((na) + (nb) + (delay)) * ((na) + (nb) + (delay) + 4) + 2 * (delay) + 65 + \
                   12 * ((nb) + (delay) - 2 > (na) ? (nb) + (delay) - 2 : (na)), 7 * ((na) + (nb) + (delay)) + 198)
#define THETAHAT_DETECTOR_WORDS THETAHAT_WORDS(8, 16)


// The most inputs of a model.
#define THETAHAT_MOST_INPUTS 4

// The most input samples on their way in an ARX or ARMAX model: the nk of all inputs, added up.
#define THETAHAT_MOST_DELAYS 16

// The most outputs that a filter or observer has.
#define THETAHAT_MOST_OUTPUTS 3

// The most coefficients of a polynomial of a controller.
#define THETAHAT_MOST_COEFFICIENTS 12

// What a function answers: 0 if all is well. A call that answers anything else has changed nothing.
enum thetahat_error
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // All is well.
    THETAHAT_ERROR_NONE = 0,
    // A pointer that is needed is NULL.
    THETAHAT_ERROR_NULL_POINTER = 1,
    // A pointer is not aligned for what it points to.
    THETAHAT_ERROR_MISALIGNED = 2,
    // There are fewer bytes of memory than the object needs.
    THETAHAT_ERROR_MEMORY_TOO_SMALL = 3,
    // The object was not initialised, or is of another kind.
    THETAHAT_ERROR_NOT_INITIALISED = 4,
    // A function of the user has called back with the object that called it.
    THETAHAT_ERROR_BUSY = 5,
    // The object has no model yet: set it first.
    THETAHAT_ERROR_NO_MODEL = 6,
    // A row of a regression, a model, or a setting holds NaN or infinity.
    THETAHAT_ERROR_NOT_FINITE = 7,
    // A sample is infinite. (NaN is a missing sample, and no error.)
    THETAHAT_ERROR_INFINITE = 8,
    // A finite number is so large that later sums could overflow.
    THETAHAT_ERROR_TOO_LARGE = 9,
    // A number that must not be negative is.
    THETAHAT_ERROR_NEGATIVE = 10,
    // An array has the wrong number of values.
    THETAHAT_ERROR_LENGTH = 11,
    // The orders make another number of parameters than the size has.
    THETAHAT_ERROR_ORDERS = 12,
    // The delays need more stored samples than the size has.
    THETAHAT_ERROR_DELAYS = 13,
    // An input acts on the output of its own sample (nk = 0): give both with `log_row`.
    THETAHAT_ERROR_INPUT_FIRST = 14,
    // A covariance is not symmetric.
    THETAHAT_ERROR_NOT_SYMMETRIC = 15,
    // A covariance has a negative variance, or correlations that no random vector can have.
    THETAHAT_ERROR_NOT_POSITIVE = 16,
    // A number lies outside its range.
    THETAHAT_ERROR_OUT_OF_RANGE = 17,
    // An innovation has no variance: the measurement and what it measures are both known exactly.
    THETAHAT_ERROR_NO_VARIANCE = 18,
    // Some states cannot be told from the outputs, so that an observer cannot place their poles.
    THETAHAT_ERROR_NOT_OBSERVABLE = 19,
    // A result does not fit the number type.
    THETAHAT_ERROR_OVERFLOW = 20,
    // Another error of the core.
    THETAHAT_ERROR_OTHER = 21,
    // An observation has a D that does not belong to the inputs of the transition: set the transition first.
    THETAHAT_ERROR_INPUTS = 22,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum thetahat_error thetahat_error;
#else
typedef int32_t thetahat_error;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What was done with a sample.
enum thetahat_action
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // The estimate was corrected.
    THETAHAT_ACTION_UPDATED = 0,
    // It was corrected, and a variance is at its bound: nothing is forgotten in its direction.
    THETAHAT_ACTION_CAPPED = 1,
    // It was corrected by less than the innovation asks for, so that C(q) stays stable.
    THETAHAT_ACTION_PROJECTED = 2,
    // The measurement is missing (NaN): time went on, nothing was corrected.
    THETAHAT_ACTION_MISSING = 3,
    // The delay lines are not filled yet: time went on, nothing was corrected.
    THETAHAT_ACTION_NOT_READY = 4,
    // Regressors are collected until they have full rank: there is no estimate yet.
    THETAHAT_ACTION_COLLECTING = 5,
    // Adaptation is off: nothing was corrected.
    THETAHAT_ACTION_FROZEN = 6,
    // The innovation lies in the dead zone: nothing was corrected.
    THETAHAT_ACTION_SKIPPED = 7,
    // The normalised innovation squared is above the gate: the measurement was not used.
    THETAHAT_ACTION_GATED = 8,
    // It is above the gate, as were those before it, so many in a row that the measurement was used.
    THETAHAT_ACTION_RELEASED = 9,
    // It was corrected by less than the innovation asks for, which is an outlier.
    THETAHAT_ACTION_BOUNDED = 10,
    // Another action of the core.
    THETAHAT_ACTION_OTHER = 11,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum thetahat_action thetahat_action;
#else
typedef int32_t thetahat_action;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How old samples are forgotten.
enum thetahat_forgetting
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Nothing is forgotten: all samples weigh the same. In single precision for a finite time only.
    THETAHAT_FORGETTING_NONE = 0,
    // A sample k samples old weighs factor^k: the memory is 1/(1 - factor) samples.
    THETAHAT_FORGETTING_EXPONENTIAL = 1,
    // Forgets, by the factor, only what the sample tells of: what is not excited is kept. For long silences.
    THETAHAT_FORGETTING_SELECTIVE = 2,
    // The parameters do a random walk: variances grow by variance/scale^2 a sample.
    THETAHAT_FORGETTING_RANDOM_WALK = 3,
    // Forgets where an innovation is large: factor, minimum and noise_variance are needed.
    THETAHAT_FORGETTING_VARIABLE = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum thetahat_forgetting thetahat_forgetting;
#else
typedef int32_t thetahat_forgetting;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What becomes of samples whose innovations are far larger than the noise makes them.
enum thetahat_outliers
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // They correct as any other.
    THETAHAT_OUTLIERS_USED = 0,
    // They correct as one of `threshold` standard deviations does: 3 loses nothing where there are none.
    THETAHAT_OUTLIERS_HUBER = 1,
    // Above a normalised innovation squared of `threshold`, such as 25, they correct nothing; after `release` of them
    // in a row the next ones do.
    THETAHAT_OUTLIERS_GATE = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum thetahat_outliers thetahat_outliers;
#else
typedef int32_t thetahat_outliers;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How an estimator starts.
enum thetahat_start
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // From a prior: P_jj = 100/scale_j^2.
    THETAHAT_START_STANDARD = 0,
    // Regressors are collected until they have full rank; the estimate is then the batch solution, without prior.
    THETAHAT_START_EXACT = 1,
    // From a prior, which is taken out over `blend` samples once the regressors have full rank.
    THETAHAT_START_MIXED = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum thetahat_start thetahat_start;
#else
typedef int32_t thetahat_start;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How a recursive ARMAX estimator corrects.
enum thetahat_armax_gradient
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Along the gradient of the prediction: converges to a minimum of the prediction error.
    THETAHAT_ARMAX_GRADIENT_PREDICTION_ERROR = 0,
    // Extended least squares: quick to converge, but not always to the truth.
    THETAHAT_ARMAX_GRADIENT_EXTENDED_LEAST_SQUARES = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum thetahat_armax_gradient thetahat_armax_gradient;
#else
typedef int32_t thetahat_armax_gradient;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What a chart watches.
enum thetahat_chart
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // None: there is no alarm.
    THETAHAT_CHART_NONE = 0,
    // Whether the mean of the innovations has risen.
    THETAHAT_CHART_MEAN_UP = 1,
    // Whether the mean of the innovations has fallen.
    THETAHAT_CHART_MEAN_DOWN = 2,
    // Whether the innovations have become larger, in either direction.
    THETAHAT_CHART_VARIANCE = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum thetahat_chart thetahat_chart;
#else
typedef int32_t thetahat_chart;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What a self-tuner did in a sample.
enum thetahat_tuner_state
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // There is no controller yet: the plant is excited.
    THETAHAT_TUNER_STATE_PROBING = 0,
    // The controller acts.
    THETAHAT_TUNER_STATE_CONTROLLING = 1,
    // The sensor says nothing, and the controller acts on what the model predicts.
    THETAHAT_TUNER_STATE_BRIDGING = 2,
    // The sensor says nothing for long: the input stays as it was.
    THETAHAT_TUNER_STATE_HOLDING = 3,
    // It is not trusted: the fallback acts. `thetahat_tuner_trusted` says why.
    THETAHAT_TUNER_STATE_DISTRUSTED = 4,
    // Another state of the core.
    THETAHAT_TUNER_STATE_OTHER = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum thetahat_tuner_state thetahat_tuner_state;
#else
typedef int32_t thetahat_tuner_state;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Why a self-tuner is not trusted.
enum thetahat_distrust
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // It is trusted.
    THETAHAT_DISTRUST_NONE = 0,
    // The gain of the model has another sign than was given, or than was known.
    THETAHAT_DISTRUST_SIGN = 1,
    // The input goes from one limit to the other while the set point stays.
    THETAHAT_DISTRUST_SATURATED = 2,
    // No controller was designed for long.
    THETAHAT_DISTRUST_AGE = 3,
    // No controller was designed for long: none of those that are tried has margins that are bearable.
    THETAHAT_DISTRUST_MARGIN = 4,
    // The model predicts worse than the latest measurement does.
    THETAHAT_DISTRUST_INNOVATIONS = 5,
    // Another reason of the core.
    THETAHAT_DISTRUST_OTHER = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum thetahat_distrust thetahat_distrust;
#else
typedef int32_t thetahat_distrust;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What acts while a self-tuner is not trusted.
enum thetahat_fallback
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // An input that stays: the mean of the inputs in the latest 64 sound samples.
    THETAHAT_FALLBACK_HOLD = 0,
    // The controller of the latest 64 sound samples.
    THETAHAT_FALLBACK_LAST_GOOD = 1,
    // An input that is given.
    THETAHAT_FALLBACK_INPUT = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum thetahat_fallback thetahat_fallback;
#else
typedef int32_t thetahat_fallback;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// An ARX or ARMAX model, estimated while the plant runs.
typedef struct thetahat_arx thetahat_arx;

// The number of parameters of a `thetahat_arx`, and its structure: `thetahat_arx_4` is ARX with 4 parameters,
// `thetahat_armax_5` ARMAX with 5.
typedef struct thetahat_arx_size thetahat_arx_size;

// Watches innovations for a change: three CUSUM charts, two on the mean and one on the variance.
typedef struct thetahat_detector thetahat_detector;

// The extended Kalman filter of x(k+1) = f(x) + w, y = h(x) + v, with w ~ (0, Q) and v ~ (0, R).
typedef struct thetahat_ekf thetahat_ekf;

// The numbers of states and outputs of a `thetahat_ekf`: `thetahat_ekf_4_2` for 4 states and 2 outputs.
typedef struct thetahat_ekf_size thetahat_ekf_size;

// The Kalman filter of x(k+1) = F x + G u + w, y = H x + D u + v, with w ~ (0, Q) and v ~ (0, R).
typedef struct thetahat_kalman thetahat_kalman;

// The numbers of states and outputs of a `thetahat_kalman`: `thetahat_kalman_4_2` for 4 states and 2 outputs.
typedef struct thetahat_kalman_size thetahat_kalman_size;

// The Luenberger observer of x(k+1) = F x + G u, y = H x + D u: x(k+1) = F x + G u + L (y - H x - D u).
typedef struct thetahat_luenberger thetahat_luenberger;

// The numbers of states and outputs of a `thetahat_luenberger`: `thetahat_luenberger_4_2` for 4 states and 2 outputs.
typedef struct thetahat_luenberger_size thetahat_luenberger_size;

// Recursive least squares: y(k) = phi(k)' theta + e(k), with a regressor and an output in each sample.
typedef struct thetahat_rls thetahat_rls;

// The number of parameters of a `thetahat_rls`: `thetahat_rls_4` for 4.
typedef struct thetahat_rls_size thetahat_rls_size;

// A linear controller R(q) u(k) = T(q) uc(k) - S(q) y(k) with limits and without windup, T = t0 Ao.
typedef struct thetahat_rst thetahat_rst;

// Pole placement for a number of coefficients: `thetahat_rst_place_2` for 2. It stands apart so that a controller with
// fixed coefficients does not link it.
typedef struct thetahat_rst_place_size thetahat_rst_place_size;

// The number of coefficients of a `thetahat_rst`: `thetahat_rst_2` for 2.
typedef struct thetahat_rst_size thetahat_rst_size;

// A controller that learns its plant while it runs: a model that it is designed for anew (indirect), or its own
// coefficients (direct).
typedef struct thetahat_tuner thetahat_tuner;

// The way and the orders of a `thetahat_tuner`. `thetahat_indirect_2_3`: a plant with na = 2 and nb = 3 coefficients
// of B(q), one more than its order for each sample of dead time; the controller integrates. `thetahat_direct_2_2_1`:
// na = 2, nb = 2, and an input that acts after 1 sample; for plants whose inverse is stable and whose delay is known.
// Both have a constant for loads.
typedef struct thetahat_tuner_size thetahat_tuner_size;

// The unscented Kalman filter of x(k+1) = f(x) + w, y = h(x) + v, with w ~ (0, Q) and v ~ (0, R). It evaluates f and h
// at 2 n + 1 points around the estimate, and never asks for a Jacobian.
typedef struct thetahat_ukf thetahat_ukf;

// The numbers of states and outputs of a `thetahat_ukf`: `thetahat_ukf_4_2` for 4 states and 2 outputs.
typedef struct thetahat_ukf_size thetahat_ukf_size;

// A word of the memory that an object is given: so it is aligned for whatever stands in it.
typedef uint64_t thetahat_word;

// The orders of one input.
typedef struct {
    // The number of coefficients.
    uint32_t nb;
    // The delay in samples, from the input to the first output it acts on.
    uint32_t nk;
} thetahat_input_orders;

#if !defined(THETAHAT_DOUBLE)
// A number of the interface: `float`, or `double` where THETAHAT_DOUBLE is defined. It must be that of the library,
// whose feature `double` makes it `double`.
typedef float thetahat_number;
#endif

#if defined(THETAHAT_DOUBLE)
// A number of the interface: `float`, or `double` where THETAHAT_DOUBLE is defined. It must be that of the library,
// whose feature `double` makes it `double`.
typedef double thetahat_number;
#endif

// The orders of an ARX or ARMAX model, and what its signals are like.
//
// y(k) + a_1 y(k-1) + ... + a_na y(k-na) = sum over the inputs of b_0 u(k-nk) + ... + b_(nb-1) u(k-nk-nb+1)
//     [+ constant] + e(k) + c_1 e(k-1) + ... + c_nc e(k-nc)
//
// The parameters are a_1 ... a_na, b_0 ... of the first input, then of the next, the constant, c_1 ... c_nc.
typedef struct {
    // The number of past outputs.
    uint32_t na;
    // The number of inputs, 0 ... THETAHAT_MOST_INPUTS.
    uint32_t inputs;
    // The orders of each input.
    thetahat_input_orders input[THETAHAT_MOST_INPUTS];
    // The number of past residuals: 0 but for sizes of ARMAX.
    uint32_t nc;
    // 1 if a constant is a parameter too, else 0.
    uint32_t constant;
    // The typical magnitude of the output, in its unit, above 0.
    thetahat_number output_scale;
    // The typical magnitude of each input, in its unit, above 0.
    thetahat_number input_scales[THETAHAT_MOST_INPUTS];
    // The typical magnitude of e, in the unit of the output, above 0: for sizes of ARMAX.
    thetahat_number noise_scale;
    // A `thetahat_armax_gradient`: for sizes of ARMAX.
    int32_t gradient;
} thetahat_arx_model;

// How an estimator of parameters learns. What is 0 and not needed by its policy is not read. NULL in its place is
// exponential forgetting with the factor 0.99 and the standard start.
typedef struct {
    // A `thetahat_forgetting`.
    int32_t forgetting;
    // Lambda, n/(n + 1) ... 1 for n parameters: for exponential, selective and variable forgetting.
    thetahat_number factor;
    // The least factor, at most the factor: for variable forgetting.
    thetahat_number minimum;
    // The growth a sample, 0 ... 100: for the random walk.
    thetahat_number variance;
    // The variance of the noise, in the unit of y squared: for variable forgetting.
    thetahat_number noise_variance;
    // A `thetahat_start`. A recursive ARMAX estimator has the standard one only.
    int32_t start;
    // In how many samples the prior is taken out, 0 ... 65535: for the mixed start.
    uint32_t blend;
    // Innovations up to this, in the unit of y, correct nothing. 0 for none.
    thetahat_number dead_zone;
    // A `thetahat_outliers`.
    int32_t outliers;
    // From 1 on: in standard deviations for Huber's rule, a normalised innovation squared for the gate.
    thetahat_number threshold;
    // After how many outliers in a row the gate lets go, 0 ... 65535; 0 for never.
    uint32_t release;
} thetahat_learning;

// The innovation of a sample: the part of the measurement that was not predicted.
typedef struct {
    // The measurement less its prediction, element by element, in the unit of the measurement. NaN where it is
    // missing.
    thetahat_number error[THETAHAT_MOST_OUTPUTS];
    // The variance of each, given those after it in the same measurement. NaN where it is missing or not known.
    thetahat_number variance[THETAHAT_MOST_OUTPUTS];
    // The normalised innovation squared: chi-square with one degree of freedom for each element that was measured, if
    // the model is right. 0 if nothing was measured, or no variance is known.
    thetahat_number nis;
    // The number of elements of a measurement.
    uint32_t outputs;
    // What was done with it, a `thetahat_action`.
    int32_t action;
} thetahat_innovation;

// What a chart says once it has passed its threshold.
typedef struct {
    // The chart, a `thetahat_chart`: NONE if no chart has passed its threshold.
    int32_t chart;
    // Since how many samples its statistic had been above 0: the most likely time since the change.
    uint32_t samples;
    // Its statistic, before it was set back to 0.
    thetahat_number statistic;
} thetahat_alarm;

// A function of the state: `value` from `state`; `context` is that of the function. Arrays do not overlap. Values are
// 0 before the call, so that only the others need be written.
typedef void (*thetahat_function_of_state)(const thetahat_number *state, thetahat_number *value, void *context);

// A function of the state and its Jacobian: f or h of a model. Inputs and time are in the context. A function that
// writes NaN or infinity makes the filter return an error and stay as it was.
typedef struct {
    // f(x), n numbers, or h(x), m numbers.
    thetahat_function_of_state value;
    // df/dx, n x n, or dh/dx, m x n, row by row. An unscented filter does not call it: it may be NULL there.
    thetahat_function_of_state jacobian;
    // What the functions are called with.
    void *context;
} thetahat_function;

// The gain and the polynomials of a controller. Shorter polynomials are filled up with zeros.
typedef struct {
    // t0: T = t0 Ao.
    thetahat_number gain;
    // R after its leading 1.
    thetahat_number r[THETAHAT_MOST_COEFFICIENTS];
    // S.
    thetahat_number s[THETAHAT_MOST_COEFFICIENTS];
    // Ao after its leading 1.
    thetahat_number observer[THETAHAT_MOST_COEFFICIENTS];
} thetahat_rst_law;

// Where the poles of the closed loop shall be. Polynomials begin with their 1.
typedef struct {
    // Am: how the output answers the set point.
    const thetahat_number *response;
    // The number of its coefficients, the 1 included.
    size_t response_count;
    // Ao: how an error of the model or the start is forgotten. { 1 } is at once.
    const thetahat_number *observer;
    // The number of its coefficients, the 1 included.
    size_t observer_count;
    // 1 if the controller integrates, so that a constant load leaves no error, else 0.
    uint32_t integrator;
    // 1 if the zeros of B are cancelled, else 0.
    uint32_t cancel_zeros;
} thetahat_rst_poles;

// What a self-tuner is asked for. `thetahat_tuner_usual` fills it in.
typedef struct {
    // The natural frequency of the response to the set point, in rad a sample: about 4/(damping n) to settle within n
    // samples.
    thetahat_number frequency;
    // Its damping, above 0 and at most 1.
    thetahat_number damping;
    // The pole by which loads and errors of the model are forgotten, 0 ... below 1.
    thetahat_number observer;
    // The range of the actuator, in the unit of the input.
    thetahat_number lowest_input;
    // The other end of it.
    thetahat_number highest_input;
    // The input that it starts with, within the range.
    thetahat_number first_input;
    // The sign of the gain of the plant; 0 where it is not known.
    thetahat_number gain_sign;
    // The usual size of the output, in its unit, above 0.
    thetahat_number output_scale;
    // The usual size of the input, in its unit, above 0.
    thetahat_number input_scale;
    // The first amplitude of probing, in the unit of the input. It doubles every 15 samples.
    thetahat_number amplitude;
    // The largest.
    thetahat_number largest_amplitude;
    // What the sensor can measure, in the unit of the output. What lies beyond is taken as the end that it passed.
    thetahat_number lowest_measurement;
    // The other end of it.
    thetahat_number highest_measurement;
    // So many equal measurements in a row are those of a sensor that is stuck, up to 65535; 0 for never.
    uint32_t stuck_after;
    // For so many missing samples in a row the controller goes on with what its model predicts, up to 65535.
    uint32_t longest_gap;
    // What acts while the tuner is not trusted, a `thetahat_fallback`.
    int32_t fallback;
    // The input of THETAHAT_FALLBACK_INPUT.
    thetahat_number fallback_input;
    // The amplitude that excites the plant then, in the unit of the input. With 0 trust may not come back by itself.
    thetahat_number excitation;
    // The largest mean share of samples in which the input is at a limit, at both of them while the set point stays, 0
    // ... 1; 1 for any.
    thetahat_number saturated;
    // For so many samples in a row a design may be refused, a quarter of it where the sign is surely wrong, up to
    // 65535; 0 for any.
    uint32_t refused;
    // The largest ratio of the mean squared innovation to the mean squared change of the measurement, 1 or more.
    thetahat_number innovations;
    // Whether the fallback acts too where the design is only old, 0 or 1: with 0 the controller goes on.
    uint32_t replace_old;
} thetahat_tuner_wish;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

extern const thetahat_rls_size thetahat_rls_1;

extern const thetahat_rls_size thetahat_rls_2;

extern const thetahat_rls_size thetahat_rls_3;

extern const thetahat_rls_size thetahat_rls_4;

extern const thetahat_rls_size thetahat_rls_5;

extern const thetahat_rls_size thetahat_rls_6;

extern const thetahat_rls_size thetahat_rls_7;

extern const thetahat_rls_size thetahat_rls_8;

extern const thetahat_rls_size thetahat_rls_9;

extern const thetahat_rls_size thetahat_rls_10;

extern const thetahat_rls_size thetahat_rls_11;

extern const thetahat_rls_size thetahat_rls_12;

extern const thetahat_rls_size thetahat_rls_13;

extern const thetahat_rls_size thetahat_rls_14;

extern const thetahat_rls_size thetahat_rls_15;

extern const thetahat_rls_size thetahat_rls_16;

extern const thetahat_arx_size thetahat_arx_1;

extern const thetahat_arx_size thetahat_arx_2;

extern const thetahat_arx_size thetahat_arx_3;

extern const thetahat_arx_size thetahat_arx_4;

extern const thetahat_arx_size thetahat_arx_5;

extern const thetahat_arx_size thetahat_arx_6;

extern const thetahat_arx_size thetahat_arx_7;

extern const thetahat_arx_size thetahat_arx_8;

extern const thetahat_arx_size thetahat_arx_9;

extern const thetahat_arx_size thetahat_arx_10;

extern const thetahat_arx_size thetahat_arx_11;

extern const thetahat_arx_size thetahat_arx_12;

extern const thetahat_arx_size thetahat_armax_1;

extern const thetahat_arx_size thetahat_armax_2;

extern const thetahat_arx_size thetahat_armax_3;

extern const thetahat_arx_size thetahat_armax_4;

extern const thetahat_arx_size thetahat_armax_5;

extern const thetahat_arx_size thetahat_armax_6;

extern const thetahat_arx_size thetahat_armax_7;

extern const thetahat_arx_size thetahat_armax_8;

extern const thetahat_arx_size thetahat_armax_9;

extern const thetahat_arx_size thetahat_armax_10;

extern const thetahat_arx_size thetahat_armax_11;

extern const thetahat_arx_size thetahat_armax_12;

extern const thetahat_kalman_size thetahat_kalman_1_1;

extern const thetahat_kalman_size thetahat_kalman_2_1;

extern const thetahat_kalman_size thetahat_kalman_2_2;

extern const thetahat_kalman_size thetahat_kalman_3_1;

extern const thetahat_kalman_size thetahat_kalman_3_2;

extern const thetahat_kalman_size thetahat_kalman_3_3;

extern const thetahat_kalman_size thetahat_kalman_4_1;

extern const thetahat_kalman_size thetahat_kalman_4_2;

extern const thetahat_kalman_size thetahat_kalman_4_3;

extern const thetahat_kalman_size thetahat_kalman_5_1;

extern const thetahat_kalman_size thetahat_kalman_5_2;

extern const thetahat_kalman_size thetahat_kalman_5_3;

extern const thetahat_kalman_size thetahat_kalman_6_1;

extern const thetahat_kalman_size thetahat_kalman_6_2;

extern const thetahat_kalman_size thetahat_kalman_6_3;

extern const thetahat_ekf_size thetahat_ekf_1_1;

extern const thetahat_ekf_size thetahat_ekf_2_1;

extern const thetahat_ekf_size thetahat_ekf_2_2;

extern const thetahat_ekf_size thetahat_ekf_3_1;

extern const thetahat_ekf_size thetahat_ekf_3_2;

extern const thetahat_ekf_size thetahat_ekf_3_3;

extern const thetahat_ekf_size thetahat_ekf_4_1;

extern const thetahat_ekf_size thetahat_ekf_4_2;

extern const thetahat_ekf_size thetahat_ekf_4_3;

extern const thetahat_ekf_size thetahat_ekf_5_1;

extern const thetahat_ekf_size thetahat_ekf_5_2;

extern const thetahat_ekf_size thetahat_ekf_5_3;

extern const thetahat_ekf_size thetahat_ekf_6_1;

extern const thetahat_ekf_size thetahat_ekf_6_2;

extern const thetahat_ekf_size thetahat_ekf_6_3;

extern const thetahat_ukf_size thetahat_ukf_1_1;

extern const thetahat_ukf_size thetahat_ukf_2_1;

extern const thetahat_ukf_size thetahat_ukf_2_2;

extern const thetahat_ukf_size thetahat_ukf_3_1;

extern const thetahat_ukf_size thetahat_ukf_3_2;

extern const thetahat_ukf_size thetahat_ukf_3_3;

extern const thetahat_ukf_size thetahat_ukf_4_1;

extern const thetahat_ukf_size thetahat_ukf_4_2;

extern const thetahat_ukf_size thetahat_ukf_4_3;

extern const thetahat_ukf_size thetahat_ukf_5_1;

extern const thetahat_ukf_size thetahat_ukf_5_2;

extern const thetahat_ukf_size thetahat_ukf_5_3;

extern const thetahat_ukf_size thetahat_ukf_6_1;

extern const thetahat_ukf_size thetahat_ukf_6_2;

extern const thetahat_ukf_size thetahat_ukf_6_3;

extern const thetahat_luenberger_size thetahat_luenberger_1_1;

extern const thetahat_luenberger_size thetahat_luenberger_2_1;

extern const thetahat_luenberger_size thetahat_luenberger_2_2;

extern const thetahat_luenberger_size thetahat_luenberger_3_1;

extern const thetahat_luenberger_size thetahat_luenberger_3_2;

extern const thetahat_luenberger_size thetahat_luenberger_3_3;

extern const thetahat_luenberger_size thetahat_luenberger_4_1;

extern const thetahat_luenberger_size thetahat_luenberger_4_2;

extern const thetahat_luenberger_size thetahat_luenberger_4_3;

extern const thetahat_luenberger_size thetahat_luenberger_5_1;

extern const thetahat_luenberger_size thetahat_luenberger_5_2;

extern const thetahat_luenberger_size thetahat_luenberger_5_3;

extern const thetahat_luenberger_size thetahat_luenberger_6_1;

extern const thetahat_luenberger_size thetahat_luenberger_6_2;

extern const thetahat_luenberger_size thetahat_luenberger_6_3;

extern const thetahat_rst_size thetahat_rst_1;

extern const thetahat_rst_size thetahat_rst_2;

extern const thetahat_rst_size thetahat_rst_3;

extern const thetahat_rst_size thetahat_rst_4;

extern const thetahat_rst_size thetahat_rst_5;

extern const thetahat_rst_size thetahat_rst_6;

extern const thetahat_rst_size thetahat_rst_7;

extern const thetahat_rst_size thetahat_rst_8;

extern const thetahat_rst_size thetahat_rst_9;

extern const thetahat_rst_size thetahat_rst_10;

extern const thetahat_rst_size thetahat_rst_11;

extern const thetahat_rst_size thetahat_rst_12;

extern const thetahat_rst_place_size thetahat_rst_place_1;

extern const thetahat_rst_place_size thetahat_rst_place_2;

extern const thetahat_rst_place_size thetahat_rst_place_3;

extern const thetahat_rst_place_size thetahat_rst_place_4;

extern const thetahat_rst_place_size thetahat_rst_place_5;

extern const thetahat_rst_place_size thetahat_rst_place_6;

extern const thetahat_rst_place_size thetahat_rst_place_7;

extern const thetahat_rst_place_size thetahat_rst_place_8;

extern const thetahat_rst_place_size thetahat_rst_place_9;

extern const thetahat_rst_place_size thetahat_rst_place_10;

extern const thetahat_rst_place_size thetahat_rst_place_11;

extern const thetahat_rst_place_size thetahat_rst_place_12;

extern const thetahat_tuner_size thetahat_indirect_1_1;

extern const thetahat_tuner_size thetahat_indirect_1_2;

extern const thetahat_tuner_size thetahat_indirect_1_3;

extern const thetahat_tuner_size thetahat_indirect_1_4;

extern const thetahat_tuner_size thetahat_indirect_2_2;

extern const thetahat_tuner_size thetahat_indirect_2_3;

extern const thetahat_tuner_size thetahat_indirect_2_4;

extern const thetahat_tuner_size thetahat_indirect_2_5;

extern const thetahat_tuner_size thetahat_indirect_3_3;

extern const thetahat_tuner_size thetahat_indirect_3_4;

extern const thetahat_tuner_size thetahat_direct_1_1_1;

extern const thetahat_tuner_size thetahat_direct_1_1_2;

extern const thetahat_tuner_size thetahat_direct_1_1_3;

extern const thetahat_tuner_size thetahat_direct_2_1_1;

extern const thetahat_tuner_size thetahat_direct_2_2_1;

extern const thetahat_tuner_size thetahat_direct_2_2_2;

extern const thetahat_tuner_size thetahat_direct_2_2_3;

// The size of a number in the library: not that of a `thetahat_number` where the header and the library disagree.
size_t thetahat_number_bytes(void);

// Makes an estimator that knows nothing yet, and has seen no sample.
//
// - arx: where its handle goes. It points into the memory.
// - memory, bytes: at least `THETAHAT_ARX_WORDS(n)` or `THETAHAT_ARMAX_WORDS(n)` words, and their size in bytes.
// - size: `&thetahat_arx_n` or `&thetahat_armax_n` for n parameters.
// - model: the orders, which make n parameters, and the scales.
// - learning: how old samples are forgotten and how it starts; NULL for the default.
//
// Errors: MEMORY_TOO_SMALL; ORDERS if the orders do not make n parameters; DELAYS; LENGTH for too many inputs;
// NOT_FINITE; OUT_OF_RANGE if a scale is not above 0, or far from 1, or a number of the policy is out of its range.
thetahat_error thetahat_arx_init(thetahat_arx **arx,
                                 thetahat_word *memory,
                                 size_t bytes,
                                 const thetahat_arx_size *size,
                                 const thetahat_arx_model *model,
                                 const thetahat_learning *learning);

// y(k) arrives: time goes on to k, and the model learns from y(k) and the inputs that were applied before. NaN is a
// missing sample. The innovation may be NULL.
//
// A controller calls measured, then computes u(k), then calls applied. A call that is left out is a missing sample.
//
// Errors, after which time has not gone on: INPUT_FIRST if an nk is 0; INFINITE; TOO_LARGE. 1.5 n^2 + 7 n
// multiply-adds, with ARMAX nc n more.
thetahat_error thetahat_arx_measured(thetahat_arx *arx,
                                     thetahat_number output,
                                     thetahat_innovation *innovation);

// u(k): what acts on the plant from now on, until the next measurement, after all limits. NaN is a missing sample.
//
// - inputs, count: one number for each input of the model.
//
// Errors: LENGTH; INFINITE; TOO_LARGE.
thetahat_error thetahat_arx_applied(thetahat_arx *arx,
                                    const thetahat_number *inputs,
                                    size_t count);

// One row of a log: y(k) and u(k), recorded at the same instant k. NaN is a missing sample. The innovation may be
// NULL.
//
// Not the call for a controller that knows u(k-1) when y(k) arrives: that calls measured and applied.
//
// Errors, after which time has not gone on: LENGTH; INFINITE; TOO_LARGE.
thetahat_error thetahat_arx_log_row(thetahat_arx *arx,
                                    thetahat_number output,
                                    const thetahat_number *inputs,
                                    size_t count,
                                    thetahat_innovation *innovation);

// The outputs to come, y(k+1), y(k+2), ... after the latest one, y(k).
//
// - inputs, count: those to come, instant by instant, one number for each input of the model: steps times the inputs.
//   After measured the first is u(k); after applied or log_row it is u(k+1).
// - outputs, steps: where they go, and how many. One that depends on a missing sample is NaN.
//
// Errors: LENGTH; INFINITE; OVERFLOW if an unstable model grows out of the number type: outputs before that are
// written, the others are NaN.
thetahat_error thetahat_arx_predict(const thetahat_arx *arx,
                                    const thetahat_number *inputs,
                                    size_t count,
                                    thetahat_number *outputs,
                                    size_t steps);

// Reads the estimate. Each of the places may be NULL.
//
// - parameters: n numbers, in the order of `thetahat_arx_model`.
// - standard_errors: n numbers; NaN until the noise variance is known, after some more samples than parameters.
// - noise_variance: the variance of e, in the unit of y squared; NaN until it is known.
thetahat_error thetahat_arx_parameters(const thetahat_arx *arx,
                                       thetahat_number *parameters,
                                       thetahat_number *standard_errors,
                                       thetahat_number *noise_variance);

// Reads P, the covariance of the parameters in units of the noise variance, n x n. n^3/6 multiply-adds.
thetahat_error thetahat_arx_covariance(const thetahat_arx *arx, thetahat_number *covariance);

// Sets the parameters, n numbers: a warm start. P stays as it is.
//
// Errors: NOT_FINITE; TOO_LARGE; OUT_OF_RANGE if C(q) is not stable.
thetahat_error thetahat_arx_set_parameters(thetahat_arx *arx, const thetahat_number *parameters);

// Sets all that a batch fit knows: its parameters, how sure they are, and the noise. The start is then the standard
// one. The samples that were seen stay.
//
// - parameters: n numbers, in the order of `thetahat_arx_model`.
// - factor: P, the covariance of the parameters over the noise variance, n x n, as P = U D U': D on the diagonal, the
//   upper triangular U above it, without the ones of its diagonal, and 0 below. If P is diagonal so is the factor, and
//   the same. In single precision a factor is always that of a covariance, where a rounded P may be none.
// - noise_variance: the variance of e, at least 0, in the unit of y squared.
// - samples: how many the fit had, more than n.
//
// Errors: NOT_FINITE; TOO_LARGE; NEGATIVE if a number of D is; OVERFLOW; OUT_OF_RANGE if C(q) is not stable, a number
// below the diagonal is not 0, or the noise variance or the samples are out of range.
thetahat_error thetahat_arx_set_fit(thetahat_arx *arx,
                                    const thetahat_number *parameters,
                                    const thetahat_number *factor,
                                    thetahat_number noise_variance,
                                    size_t samples);

// Sets P, the covariance of the parameters over the noise variance, n x n, symmetric. Parameters and noise variance
// stay. 2.5 n^3 multiply-adds.
//
// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE; TOO_LARGE.
thetahat_error thetahat_arx_set_covariance(thetahat_arx *arx,
                                           const thetahat_number *covariance);

// Takes P for larger by a factor, at least 1: what was learnt counts that much less, and the next samples more. For a
// plant that has changed, as after a repair.
//
// Errors: OUT_OF_RANGE; TOO_LARGE; OVERFLOW.
thetahat_error thetahat_arx_widen(thetahat_arx *arx,
                                  thetahat_number factor);

// Turns adaptation off (0), or on again (1). While it is off innovations are computed and nothing changes.
thetahat_error thetahat_arx_set_adaptation(thetahat_arx *arx, uint32_t on);

// Makes charts at 0.
//
// - detector: where its handle goes. It points into the memory.
// - memory, bytes: at least `THETAHAT_DETECTOR_WORDS` words, and their size in bytes.
// - mean_threshold, variance_threshold: above 0. A chart with the threshold h gives at most one false alarm in exp(h)
//   samples on average; INFINITY turns it off.
//
// Errors: MEMORY_TOO_SMALL; OUT_OF_RANGE.
thetahat_error thetahat_detector_init(thetahat_detector **detector,
                                      thetahat_word *memory,
                                      size_t bytes,
                                      thetahat_number mean_threshold,
                                      thetahat_number variance_threshold);

// Takes the innovation of a sample, of an estimator or filter. One that is missing, or whose variance is not known,
// changes nothing. Of several outputs the normalised square is watched, by the chart of the variance alone.
//
// - alarm: what the charts say. Its chart is NONE if they say nothing.
//
// Errors: NULL_POINTER; LENGTH if the innovation has no outputs, or more than THETAHAT_MOST_OUTPUTS.
thetahat_error thetahat_detector_update(thetahat_detector *detector,
                                        const thetahat_innovation *innovation,
                                        thetahat_alarm *alarm);

// Sets all charts back to 0, as after a change that is known.
thetahat_error thetahat_detector_reset(thetahat_detector *detector);

// Makes a filter that starts from this state and the covariance of its error. Set the noise next.
//
// - ekf: where its handle goes. It points into the memory.
// - memory, bytes: at least `THETAHAT_EKF_WORDS(n, m)` words, and their size in bytes.
// - size: `&thetahat_ekf_n_m` for n states and m outputs.
// - state: x, n numbers.
// - covariance: P, n x n, symmetric; NULL for 0, a state that is known.
//
// Errors: MEMORY_TOO_SMALL; NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
thetahat_error thetahat_ekf_init(thetahat_ekf **ekf,
                                 thetahat_word *memory,
                                 size_t bytes,
                                 const thetahat_ekf_size *size,
                                 const thetahat_number *state,
                                 const thetahat_number *covariance);

// Sets Q, n x n, and R, m x m; NULL for 0. Set them again where they depend on the state or vary in time. About n^3 +
// m^3 multiply-adds.
//
// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
thetahat_error thetahat_ekf_set_noise(thetahat_ekf *ekf,
                                      const thetahat_number *process_noise,
                                      const thetahat_number *measurement_noise);

// Puts the state where it is known to be, n numbers. P stays, and what the gate has counted starts anew.
//
// Errors: NOT_FINITE.
thetahat_error thetahat_ekf_set_state(thetahat_ekf *ekf, const thetahat_number *state);

// Sets P, the covariance of the error of the state, n x n, symmetric; NULL for 0. The state stays. 2.5 n^3
// multiply-adds.
//
// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
thetahat_error thetahat_ekf_set_covariance(thetahat_ekf *ekf, const thetahat_number *covariance);

// Takes P for larger by a factor, at least 1: the next measurements move the state more. For a state that is less sure
// than P says, as after a fault.
//
// Errors: OUT_OF_RANGE; OVERFLOW.
thetahat_error thetahat_ekf_widen(thetahat_ekf *ekf,
                                  thetahat_number factor);

// Sets a gate, and after how many measurements above it in a row it lets go: as `thetahat_kalman_set_gate`.
//
// Errors: OUT_OF_RANGE.
thetahat_error thetahat_ekf_set_gate(thetahat_ekf *ekf, thetahat_number gate, uint32_t release);

// Sets how often a measurement update linearises h, each time about its last result: 1 at first, 1 or more.
//
// Errors: OUT_OF_RANGE.
thetahat_error thetahat_ekf_set_iterations(thetahat_ekf *ekf, uint32_t count);

// The time update: one sample ahead. The functions of the transition must not call with this filter: that answers
// BUSY. About 1.5 n^3 multiply-adds, where the quick way would lose digits n^3 more.
//
// Errors: NOT_FINITE if the next state or the Jacobian is NaN or infinite; OVERFLOW.
thetahat_error thetahat_ekf_predict(thetahat_ekf *ekf,
                                    const thetahat_function *transition);

// The measurement update. A NaN in the measurement is a missing element: it is skipped alone, and the others are used.
// The functions of the observation must not call with this filter: that answers BUSY. For each linearisation about m
// (1.5 n^2 + 6 n) multiply-adds.
//
// - observation: h, and its Jacobian.
// - measurement: y(k), m numbers.
// - innovation: what was new; may be NULL.
//
// Errors: INFINITE; NOT_FINITE if h or its Jacobian is NaN or infinite; NO_VARIANCE; TOO_LARGE.
thetahat_error thetahat_ekf_correct(thetahat_ekf *ekf,
                                    const thetahat_function *observation,
                                    const thetahat_number *measurement,
                                    thetahat_innovation *innovation);

// Reads the state, n numbers.
thetahat_error thetahat_ekf_state(const thetahat_ekf *ekf, thetahat_number *state);

// Reads P, the covariance of the error of the state as far as the linearised model knows it, n x n. n^3/6
// multiply-adds.
thetahat_error thetahat_ekf_covariance(const thetahat_ekf *ekf, thetahat_number *covariance);

// The name of an error: `NOT_FINITE` for `THETAHAT_ERROR_NOT_FINITE`; `UNKNOWN` for what is none. It lives for ever.
const char *thetahat_error_name(int32_t code);

// What is wrong and what to do, in a sentence. It lives for ever.
const char *thetahat_error_text(int32_t code);

// An action in a word or two, such as `not ready`; `other` for what is none. It lives for ever.
const char *thetahat_action_word(int32_t action);

// Makes a filter that starts from this state and the covariance of its error. Set the transition and the observation
// next.
//
// - kalman: where its handle goes. It points into the memory.
// - memory, bytes: at least `THETAHAT_KALMAN_WORDS(n, m)` words, and their size in bytes.
// - size: `&thetahat_kalman_n_m` for n states and m outputs.
// - state: x, n numbers.
// - covariance: P, n x n, symmetric; NULL for 0, a state that is known.
//
// Errors: MEMORY_TOO_SMALL; NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
thetahat_error thetahat_kalman_init(thetahat_kalman **kalman,
                                    thetahat_word *memory,
                                    size_t bytes,
                                    const thetahat_kalman_size *size,
                                    const thetahat_number *state,
                                    const thetahat_number *covariance);

// Sets how the state moves on: x(k+1) = F x + G u + w, w ~ (0, Q). It may be set again at any time.
//
// - state_matrix: F, n x n, row by row, as all matrices.
// - input_matrix, inputs: G, n x inputs, with 0 ... THETAHAT_MOST_INPUTS inputs; NULL for none.
// - noise: Q, n x n; NULL for 0.
//
// Errors: LENGTH for too many inputs; INPUTS if their number changes and the observation has a D that is not 0;
// NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE; OVERFLOW.
thetahat_error thetahat_kalman_set_transition(thetahat_kalman *kalman,
                                              const thetahat_number *state_matrix,
                                              const thetahat_number *input_matrix,
                                              size_t inputs,
                                              const thetahat_number *noise);

// Sets what is measured: y = H x + D u + v, v ~ (0, R). It may be set again at any time.
//
// - output_matrix: H, m x n.
// - input_matrix: D, m x inputs, with the inputs of the transition, which is set before; NULL for 0, or where there
//   are none.
// - noise: R, m x m; NULL for 0.
//
// Errors: INPUTS if D is given and the transition is not set, or has no inputs; NOT_FINITE; NOT_SYMMETRIC;
// NOT_POSITIVE.
thetahat_error thetahat_kalman_set_observation(thetahat_kalman *kalman,
                                               const thetahat_number *output_matrix,
                                               const thetahat_number *input_matrix,
                                               const thetahat_number *noise);

// Puts the state where it is known to be, n numbers. P stays, and what the gate has counted starts anew.
//
// Errors: NOT_FINITE.
thetahat_error thetahat_kalman_set_state(thetahat_kalman *kalman, const thetahat_number *state);

// Sets P, the covariance of the error of the state, n x n, symmetric; NULL for 0. The state stays. 2.5 n^3
// multiply-adds.
//
// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
thetahat_error thetahat_kalman_set_covariance(thetahat_kalman *kalman, const thetahat_number *covariance);

// Takes P for larger by a factor, at least 1: the next measurements move the state more. For a state that is less sure
// than P says, as after a fault.
//
// Errors: OUT_OF_RANGE; OVERFLOW.
thetahat_error thetahat_kalman_widen(thetahat_kalman *kalman,
                                     thetahat_number factor);

// Sets a gate: a measurement whose normalised innovation squared is above it is not used. INFINITY for none, as at
// first. After `release` such measurements in a row, 1 ... 65535, those that follow are used all the same; 0 for
// never.
//
// Errors: OUT_OF_RANGE.
thetahat_error thetahat_kalman_set_gate(thetahat_kalman *kalman,
                                        thetahat_number gate,
                                        uint32_t release);

// The time update: one sample ahead, with the inputs u(k) of the transition; NULL where there are none. About 1.2 n^3
// multiply-adds, where the quick way would lose digits n^3 more.
//
// Errors: NO_MODEL; NOT_FINITE; OVERFLOW.
thetahat_error thetahat_kalman_predict(thetahat_kalman *kalman,
                                       const thetahat_number *input);

// The measurement update. A NaN in the measurement is a missing element: it is skipped alone, and the others are used.
// About m (1.5 n^2 + 6 n) multiply-adds.
//
// - input: u(k), the inputs of the transition; NULL where there are none.
// - measurement: y(k), m numbers.
// - innovation: what was new; may be NULL.
//
// Errors: NO_MODEL; INFINITE; NOT_FINITE if an input is NaN or infinite; NO_VARIANCE; TOO_LARGE.
thetahat_error thetahat_kalman_correct(thetahat_kalman *kalman,
                                       const thetahat_number *input,
                                       const thetahat_number *measurement,
                                       thetahat_innovation *innovation);

// Reads the state, n numbers.
thetahat_error thetahat_kalman_state(const thetahat_kalman *kalman, thetahat_number *state);

// Reads P, the covariance of the error of the state, n x n. n^3/6 multiply-adds.
thetahat_error thetahat_kalman_covariance(const thetahat_kalman *kalman, thetahat_number *covariance);

// Makes an observer that starts from this state. Set the transition and the observation next.
//
// - luenberger: where its handle goes. It points into the memory.
// - memory, bytes: at least `THETAHAT_LUENBERGER_WORDS(n, m)` words, and their size in bytes.
// - size: `&thetahat_luenberger_n_m` for n states and m outputs.
// - state: x, n numbers.
// - gain: L, n x m, row by row; NULL for 0, until poles are placed.
//
// Errors: MEMORY_TOO_SMALL; NOT_FINITE.
thetahat_error thetahat_luenberger_init(thetahat_luenberger **luenberger,
                                        thetahat_word *memory,
                                        size_t bytes,
                                        const thetahat_luenberger_size *size,
                                        const thetahat_number *state,
                                        const thetahat_number *gain);

// Sets how the state moves on: x(k+1) = F x + G u. It may be set again at any time.
//
// - state_matrix: F, n x n, row by row, as all matrices.
// - input_matrix, inputs: G, n x inputs, with 0 ... THETAHAT_MOST_INPUTS inputs; NULL for none.
//
// Errors: LENGTH for too many inputs; INPUTS if their number changes and the observation has a D that is not 0;
// NOT_FINITE.
thetahat_error thetahat_luenberger_set_transition(thetahat_luenberger *luenberger,
                                                  const thetahat_number *state_matrix,
                                                  const thetahat_number *input_matrix,
                                                  size_t inputs);

// Sets what is measured: y = H x + D u. It may be set again at any time.
//
// - output_matrix: H, m x n.
// - input_matrix: D, m x inputs, with the inputs of the transition, which is set before; NULL for 0, or where there
//   are none.
//
// Errors: INPUTS if D is given and the transition is not set, or has no inputs; NOT_FINITE.
thetahat_error thetahat_luenberger_set_observation(thetahat_luenberger *luenberger,
                                                   const thetahat_number *output_matrix,
                                                   const thetahat_number *input_matrix);

// Sets the gain so that F - L H has these poles. Complex poles come in conjugate pairs, side by side. 4 n^3
// multiply-adds.
//
// - real, imaginary: the parts of the poles, n numbers each; all inside the unit circle.
// - weights: m numbers by which the outputs are combined into one; NULL for 1 each.
//
// Errors: NO_MODEL; NOT_OBSERVABLE; OUT_OF_RANGE; NOT_FINITE; OVERFLOW.
thetahat_error thetahat_luenberger_place(thetahat_luenberger *luenberger,
                                         const thetahat_number *real,
                                         const thetahat_number *imaginary,
                                         const thetahat_number *weights);

// One sample ahead, with u(k) and y(k). A NaN in the measurement is a missing element: its error counts as 0. n m
// multiply-adds, and the model's.
//
// - input: u(k), the inputs of the transition; NULL where there are none.
// - measurement: y(k), m numbers.
// - innovation: the errors y - H x - D u; an observer knows no variances. May be NULL.
//
// Errors: NO_MODEL; INFINITE; NOT_FINITE if an input is NaN or infinite; TOO_LARGE.
thetahat_error thetahat_luenberger_update(thetahat_luenberger *luenberger,
                                          const thetahat_number *input,
                                          const thetahat_number *measurement,
                                          thetahat_innovation *innovation);

// Puts the estimate where the state is known to be, n numbers.
//
// Errors: NOT_FINITE.
thetahat_error thetahat_luenberger_set_state(thetahat_luenberger *luenberger, const thetahat_number *state);

// Reads the state at the next sample, n numbers.
thetahat_error thetahat_luenberger_state(const thetahat_luenberger *luenberger, thetahat_number *state);

// Reads the gain L, n x m, row by row.
thetahat_error thetahat_luenberger_gain(const thetahat_luenberger *luenberger, thetahat_number *gain);

// Makes an estimator that knows nothing yet: theta = 0.
//
// - rls: where its handle goes. It points into the memory.
// - memory, bytes: at least `THETAHAT_RLS_WORDS(n)` words, and their size in bytes.
// - size: `&thetahat_rls_n` for n parameters.
// - scales: n typical magnitudes of the regressors. They set the prior, P_jj = 100/scale_j^2.
// - learning: how old samples are forgotten and how it starts; NULL for the default.
//
// Errors: MEMORY_TOO_SMALL; NOT_FINITE; OUT_OF_RANGE if a scale is not above 0, or far from 1, or a number of the
// policy is out of its range.
thetahat_error thetahat_rls_init(thetahat_rls **rls,
                                 thetahat_word *memory,
                                 size_t bytes,
                                 const thetahat_rls_size *size,
                                 const thetahat_number *scales,
                                 const thetahat_learning *learning);

// One sample: corrects the estimate by phi and y = phi' theta + e. NaN in either is a missing sample.
//
// - regressor: phi, n numbers.
// - output: y.
// - innovation: what the sample told; may be NULL.
//
// Errors: INFINITE; TOO_LARGE for numbers whose products could overflow. 1.5 n^2 + 7 n multiply-adds.
thetahat_error thetahat_rls_update(thetahat_rls *rls,
                                   const thetahat_number *regressor,
                                   thetahat_number output,
                                   thetahat_innovation *innovation);

// phi' theta: the output that n regressors predict, in the unit of y. n multiply-adds.
//
// Errors: NOT_FINITE if a regressor is NaN or infinite; OVERFLOW.
thetahat_error thetahat_rls_predict(const thetahat_rls *rls,
                                    const thetahat_number *regressor,
                                    thetahat_number *output);

// Reads the estimate. Each of the places may be NULL.
//
// - parameters: theta, n numbers.
// - standard_errors: those of theta, n numbers; NaN until the noise variance is known, after some more samples than
//   parameters.
// - noise_variance: the variance of e, in the unit of y squared; NaN until it is known.
thetahat_error thetahat_rls_parameters(const thetahat_rls *rls,
                                       thetahat_number *parameters,
                                       thetahat_number *standard_errors,
                                       thetahat_number *noise_variance);

// Reads P, the covariance of theta in units of the noise variance, n x n. n^3/6 multiply-adds.
thetahat_error thetahat_rls_covariance(const thetahat_rls *rls, thetahat_number *covariance);

// Sets the parameters, n numbers: a warm start. P stays as it is.
//
// Errors: NOT_FINITE; TOO_LARGE.
thetahat_error thetahat_rls_set_parameters(thetahat_rls *rls, const thetahat_number *parameters);

// Sets P, the covariance of the parameters over the noise variance, n x n, symmetric. Parameters and noise variance
// stay. 2.5 n^3 multiply-adds.
//
// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE; TOO_LARGE.
thetahat_error thetahat_rls_set_covariance(thetahat_rls *rls,
                                           const thetahat_number *covariance);

// Takes P for larger by a factor, at least 1: what was learnt counts that much less, and the next samples more. For a
// plant that has changed, as after a repair.
//
// Errors: OUT_OF_RANGE; TOO_LARGE; OVERFLOW.
thetahat_error thetahat_rls_widen(thetahat_rls *rls,
                                  thetahat_number factor);

// Turns adaptation off (0), or on again (1). While it is off innovations are computed and nothing changes.
thetahat_error thetahat_rls_set_adaptation(thetahat_rls *rls, uint32_t on);

// Makes a controller at rest, without limits.
//
// - rst: where its handle goes. It points into the memory.
// - memory, bytes: at least `THETAHAT_RST_WORDS(n)` words, and their size in bytes.
// - size: `&thetahat_rst_n` for n coefficients each.
// - law: the gain and the first n coefficients of its polynomials.
//
// Errors: MEMORY_TOO_SMALL; NOT_FINITE.
thetahat_error thetahat_rst_init(thetahat_rst **rst,
                                 thetahat_word *memory,
                                 size_t bytes,
                                 const thetahat_rst_size *size,
                                 const thetahat_rst_law *law);

// Sets the limits of the input, in its unit. Infinite ones are none.
//
// Errors: OUT_OF_RANGE if they are NaN, or the lower one is above the upper one.
thetahat_error thetahat_rst_set_limits(thetahat_rst *rst, thetahat_number lowest, thetahat_number highest);

// Takes over from a hand: if the measurement and the set point stay as they are, the input stays at this one first.
thetahat_error thetahat_rst_start(thetahat_rst *rst,
                                  thetahat_number input,
                                  thetahat_number measurement,
                                  thetahat_number set_point);

// One sample: the input from now on, within the limits. With a measurement that is NaN or infinite it stays as it was.
// 4 n multiply-adds.
//
// Errors: NULL_POINTER.
thetahat_error thetahat_rst_control(thetahat_rst *rst,
                                    thetahat_number set_point,
                                    thetahat_number measurement,
                                    thetahat_number *input);

// Tells that the actuator did something else than the latest control asked for.
thetahat_error thetahat_rst_applied(thetahat_rst *rst, thetahat_number input);

// Computes the controller of lowest order that places the poles of the closed loop with a model A(q) y = B(q) u, for
// `thetahat_rst_init`. About 10 n^3 flops.
//
// - size: `&thetahat_rst_place_n`, with n = na + nb - 1, one more with an integrator, where na and nb are the highest
//   powers of 1/q in A and B.
// - a, a_count: A, na + 1 coefficients that begin with 1.
// - b, b_count: B, nb + 1 coefficients that begin with 0, and with more zeros for a longer delay.
// - poles: where the poles shall be.
// - law: where the controller goes.
//
// Errors, after which nothing is written: NOT_FINITE; OUT_OF_RANGE if a polynomial does not begin as it must, B(1) is
// 0, a zero that shall be cancelled is not inside the unit circle, or A and B have a common factor, nearly; ORDERS if
// n is another; LENGTH if Am Ao has more than n coefficients after its 1; TOO_LARGE; OVERFLOW.
thetahat_error thetahat_rst_place(const thetahat_rst_place_size *size,
                                  const thetahat_number *a,
                                  size_t a_count,
                                  const thetahat_number *b,
                                  size_t b_count,
                                  const thetahat_rst_poles *poles,
                                  thetahat_rst_law *law);

// Fills in what is usual, for these scales, and ends of the actuator's range: a response of 0.1 rad a sample with
// damping 0.9, an observer of 0.5, the input 0 or the nearest end of the range at first, nothing known of the gain,
// probing with a tenth of the scale to twice, any range of the sensor, never stuck, 100 missing samples from the
// model. Where it is not trusted the input is held, and excited by a tenth of the scale; for that half of the samples
// are at the limits, 200 designs refused, or innovations twice the changes.
//
// Errors: NULL_POINTER.
thetahat_error thetahat_tuner_usual(thetahat_tuner_wish *wish,
                                    thetahat_number output_scale,
                                    thetahat_number input_scale,
                                    thetahat_number lowest_input,
                                    thetahat_number highest_input);

// Makes a tuner that knows nothing yet.
//
// - tuner: where its handle goes. It points into the memory.
// - memory, bytes: at least `THETAHAT_INDIRECT_WORDS(na, nb)` or `THETAHAT_DIRECT_WORDS(na, nb, delay)` words, and
//   their size in bytes.
// - size: `&thetahat_indirect_na_nb` or `&thetahat_direct_na_nb_delay`.
// - wish: what is asked for.
// - learning: how old samples are forgotten and how it starts, without its dead zone; NULL for the default. The random
//   walk with a variance of 1e-4 tracks best, where the scales are right; else exponential forgetting with 0.98.
//
// Errors: MEMORY_TOO_SMALL; NOT_FINITE; OUT_OF_RANGE if a number of the wish or of the policy is out of its range.
thetahat_error thetahat_tuner_init(thetahat_tuner **tuner,
                                   thetahat_word *memory,
                                   size_t bytes,
                                   const thetahat_tuner_size *size,
                                   const thetahat_tuner_wish *wish,
                                   const thetahat_learning *learning);

// One sample: the tuner learns from the measurement, and gives the input from now on, within the limits. A measurement
// that is NaN is missing. A step costs what that of a recursive ARX estimator does, and in an indirect tuner a design
// of about 10 n^3 + 560 n flops, n = na + nb.
//
// Errors: NULL_POINTER.
thetahat_error thetahat_tuner_control(thetahat_tuner *tuner,
                                      thetahat_number set_point,
                                      thetahat_number measurement,
                                      thetahat_number *input);

// Tells that the actuator did something else than the latest control asked for.
thetahat_error thetahat_tuner_applied(thetahat_tuner *tuner, thetahat_number input);

// Excites the plant for so many samples: the input is that of the controller with the share 0 ... 1 of the largest
// amplitude of probing, with either sign.
//
// Errors: OUT_OF_RANGE.
thetahat_error thetahat_tuner_probe(thetahat_tuner *tuner,
                                    thetahat_number share,
                                    uint32_t samples);

// Turns adaptation off (0), or on again (1): the controller stays as it is.
thetahat_error thetahat_tuner_set_adaptation(thetahat_tuner *tuner, uint32_t on);

// Reads what it did in the latest sample, and what it has learnt. Each of the places may be NULL.
//
// - state: a `thetahat_tuner_state`.
// - parameters: of an indirect tuner a_1 ..., b_1 ..., the constant: na + nb + 1 numbers. Of a direct one the
//   coefficients of R, nb + delay - 1, those of S, na, and the constant.
thetahat_error thetahat_tuner_read(const thetahat_tuner *tuner, int32_t *state, thetahat_number *parameters);

// Reads whether it is trusted. Each of the places may be NULL.
//
// - distrust: why it is not, a `thetahat_distrust`.
// - innovation: what the latest measurement told the model.
// - design_age: the samples since the latest design that was accepted.
thetahat_error thetahat_tuner_trusted(const thetahat_tuner *tuner,
                                      int32_t *distrust,
                                      thetahat_innovation *innovation,
                                      uint32_t *design_age);

// Trusts it from now on: the controller acts, or the plant is excited until there is one. It comes back by itself
// where the model is good again; this is for a user who knows better.
thetahat_error thetahat_tuner_trust(thetahat_tuner *tuner);

// Says that the gain of the plant has this sign from now on, or 0 that it is not known.
//
// Errors: OUT_OF_RANGE if it is not finite.
thetahat_error thetahat_tuner_set_gain_sign(thetahat_tuner *tuner, thetahat_number sign);

// What acts from now on while it is not trusted: a `thetahat_fallback`, and the input of THETAHAT_FALLBACK_INPUT.
//
// Errors: OUT_OF_RANGE if it is none, or that input is not finite.
thetahat_error thetahat_tuner_set_fallback(thetahat_tuner *tuner,
                                           int32_t kind,
                                           thetahat_number input);

// Makes a filter that starts from this state and the covariance of its error. Set the noise next.
//
// - ukf: where its handle goes. It points into the memory.
// - memory, bytes: at least `THETAHAT_UKF_WORDS(n, m)` words, and their size in bytes.
// - size: `&thetahat_ukf_n_m` for n states and m outputs.
// - state: x, n numbers.
// - covariance: P, n x n, symmetric; NULL for 0, a state that is known.
//
// Errors: MEMORY_TOO_SMALL; NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
thetahat_error thetahat_ukf_init(thetahat_ukf **ukf,
                                 thetahat_word *memory,
                                 size_t bytes,
                                 const thetahat_ukf_size *size,
                                 const thetahat_number *state,
                                 const thetahat_number *covariance);

// Sets Q, n x n, and R, m x m; NULL for 0. Set them again where they depend on the state or vary in time. About n^3 +
// m^3 multiply-adds.
//
// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
thetahat_error thetahat_ukf_set_noise(thetahat_ukf *ukf,
                                      const thetahat_number *process_noise,
                                      const thetahat_number *measurement_noise);

// Puts the state where it is known to be, n numbers. P stays, and what the gate has counted starts anew.
//
// Errors: NOT_FINITE.
thetahat_error thetahat_ukf_set_state(thetahat_ukf *ukf, const thetahat_number *state);

// Sets P, the covariance of the error of the state, n x n, symmetric; NULL for 0. The state stays. 2.5 n^3
// multiply-adds.
//
// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE.
thetahat_error thetahat_ukf_set_covariance(thetahat_ukf *ukf, const thetahat_number *covariance);

// Takes P for larger by a factor, at least 1: the next measurements move the state more. For a state that is less sure
// than P says, as after a fault.
//
// Errors: OUT_OF_RANGE; OVERFLOW.
thetahat_error thetahat_ukf_widen(thetahat_ukf *ukf,
                                  thetahat_number factor);

// Sets a gate, and after how many measurements above it in a row it lets go: as `thetahat_kalman_set_gate`.
//
// Errors: OUT_OF_RANGE.
thetahat_error thetahat_ukf_set_gate(thetahat_ukf *ukf, thetahat_number gate, uint32_t release);

// Sets how many standard deviations the points are from the estimate: sqrt(3) at first, 1 ... 10. Smaller: for
// functions that are not defined far away, or bend otherwise there. With 1 the covariance knows nothing of bends.
//
// Errors: OUT_OF_RANGE.
thetahat_error thetahat_ukf_set_spread(thetahat_ukf *ukf,
                                       thetahat_number spread);

// The time update: one sample ahead. The functions of the transition must not call with this filter: that answers
// BUSY. 2 n + 1 times f, and about 4 n^3 multiply-adds.
//
// Errors: NOT_FINITE if the next state of one of the points is NaN or infinite; OVERFLOW.
thetahat_error thetahat_ukf_predict(thetahat_ukf *ukf,
                                    const thetahat_function *transition);

// The measurement update. A NaN in the measurement is a missing element: it is skipped alone, and the others are used.
// The functions of the observation must not call with this filter: that answers BUSY. 2 n + 1 times h, and about m
// (2 n^2 + 2 n m + 6 n) multiply-adds.
//
// - observation: h. Its Jacobian is not called, and may be NULL.
// - measurement: y(k), m numbers.
// - innovation: what was new; may be NULL.
//
// Errors: INFINITE; NOT_FINITE if h at one of the points is NaN or infinite; NO_VARIANCE; TOO_LARGE.
thetahat_error thetahat_ukf_correct(thetahat_ukf *ukf,
                                    const thetahat_function *observation,
                                    const thetahat_number *measurement,
                                    thetahat_innovation *innovation);

// Reads the state, n numbers.
thetahat_error thetahat_ukf_state(const thetahat_ukf *ukf, thetahat_number *state);

// Reads P, the covariance of the error of the state as far as the points know it, n x n. n^3/6
// multiply-adds.
thetahat_error thetahat_ukf_covariance(const thetahat_ukf *ukf, thetahat_number *covariance);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* THETAHAT_H */
