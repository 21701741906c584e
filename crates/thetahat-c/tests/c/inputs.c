/* D of an observation belongs to the inputs of the transition: it is taken with them or refused, never dropped. */
#include <string.h>

#include "done.h"

static const thetahat_number zeros[4] = {0, 0, 0, 0}, unit[4] = {1, 0, 0, 1};
static const thetahat_number direct[2] = {2, 3}, u[2] = {10, 7};

/* Ends the program if a call was not refused. */
static void refused(const char *name, int32_t code) {
    if (code != THETAHAT_ERROR_INPUTS || strcmp(thetahat_error_name(code), "INPUTS") != 0) {
        printf("%s: %s where INPUTS was expected\n", name, thetahat_error_name(code));
        exit(1);
    }
}

/* Prints what is new in y = D u. */
static void print_error(thetahat_kalman *kalman, thetahat_number y) {
    thetahat_innovation innovation;
    done("correct", thetahat_kalman_correct(kalman, u, &y, &innovation));
    printf(" %g", (double)innovation.error[0]);
}

int main(void) {
    static thetahat_word memory[THETAHAT_KALMAN_WORDS(2, 1)], observer_memory[THETAHAT_LUENBERGER_WORDS(2, 1)];
    thetahat_kalman *kalman;
    thetahat_luenberger *observer;
    done("init", thetahat_kalman_init(&kalman, memory, sizeof memory, &thetahat_kalman_2_1, zeros, unit));
    refused("observation first", thetahat_kalman_set_observation(kalman, unit, direct, unit));
    done("transition", thetahat_kalman_set_transition(kalman, unit, zeros, 1, unit));
    done("observation", thetahat_kalman_set_observation(kalman, unit, direct, unit));
    print_error(kalman, 20);
    refused("another number of inputs", thetahat_kalman_set_transition(kalman, unit, zeros, 2, unit));
    print_error(kalman, 20);
    done("without D", thetahat_kalman_set_observation(kalman, unit, NULL, unit));
    done("two inputs", thetahat_kalman_set_transition(kalman, unit, zeros, 2, unit));
    done("D of two", thetahat_kalman_set_observation(kalman, unit, direct, unit));
    print_error(kalman, 41);

    done("init", thetahat_luenberger_init(&observer, observer_memory, sizeof observer_memory, &thetahat_luenberger_2_1,
                                          zeros, NULL));
    refused("observation first", thetahat_luenberger_set_observation(observer, unit, direct));
    done("transition", thetahat_luenberger_set_transition(observer, unit, zeros, 1));
    done("observation", thetahat_luenberger_set_observation(observer, unit, direct));
    refused("another number of inputs", thetahat_luenberger_set_transition(observer, unit, zeros, 2));
    printf("\n");
    return 0;
}
