/*
 * What a step of an exported model costs. The linker puts these functions before those of the model (--wrap), so that the
 * program that checks the model is what it is on the host. At the end they print bytes of the state, and the instructions of
 * a sample: the median and the most.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "model.h"

/* The system timer: it counts 24 bits down, 25.6 ticks an instruction (`-icount shift=10`). */
#define CONTROL (*(volatile uint32_t *)0xe000e010)
#define RELOAD (*(volatile uint32_t *)0xe000e014)
#define CURRENT (*(volatile uint32_t *)0xe000e018)
#define LARGEST 0xffffffU

#define MOST 4096U

/* All arguments of a step are addresses, four at the most: they stay in their registers, and so does what it returns, if it does: how many numbers
   are missing. */
typedef unsigned int step(const void *a, const void *b, const void *c, const void *d);

/* The instructions of each sample. */
static uint32_t samples[MOST];
static uint32_t count;
/* The ticks between two readings with nothing in between. */
static uint32_t nothing;

static int larger(const void *one, const void *other) {
    const uint32_t a = *(const uint32_t *)one;
    const uint32_t b = *(const uint32_t *)other;
    return (a > b) - (a < b);
}

static void report(void) {
    qsort(samples, count, sizeof samples[0], larger);
    printf("%u %u %u\n", (unsigned)sizeof(model_state), (unsigned)samples[count / 2U], (unsigned)samples[count - 1U]);
}

static void start(void) {
    RELOAD = LARGEST;
    CONTROL = 5U;
    CURRENT = 0U;
    const uint32_t before = CURRENT;
    nothing = (before - CURRENT) & LARGEST;
    atexit(report);
}

/* Adds the cost of a call to the sample that is going on. */
static unsigned int measure(step *work, const void *a, const void *b, const void *c, const void *d) {
    CURRENT = 0U;
    const uint32_t before = CURRENT;
    const unsigned int returned = work(a, b, c, d);
    const uint32_t ticks = ((before - CURRENT) & LARGEST) - nothing;
    if (count > 0U) {
        samples[count - 1U] += (ticks * 10U + 128U) / 256U;
    }
    return returned;
}

static void next_sample(void) {
    if (count == 0U) {
        start();
    }
    count += count < MOST ? 1U : 0U;
}

/* A function of the model that begins a sample, and one that goes on with it. */
#define BEGINS(name)                                                                                                   \
    step __real_##name, __wrap_##name;                                                                                 \
    unsigned int __wrap_##name(const void *a, const void *b, const void *c, const void *d) {                           \
        next_sample();                                                                                                 \
        return measure(__real_##name, a, b, c, d);                                                                     \
    }
#define GOES_ON(name)                                                                                                  \
    step __real_##name, __wrap_##name;                                                                                 \
    unsigned int __wrap_##name(const void *a, const void *b, const void *c, const void *d) {                           \
        return measure(__real_##name, a, b, c, d);                                                                     \
    }

#if defined(PREDICTOR)
BEGINS(model_predict)
GOES_ON(model_update)
#elif defined(OBSERVER)
BEGINS(model_observe)
#elif defined(CONTROLLER)
BEGINS(model_control)
#else
BEGINS(model_step)
#endif
