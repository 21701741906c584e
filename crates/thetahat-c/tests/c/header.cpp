// The header in C++.
#include "thetahat.h"

static thetahat_word memory[THETAHAT_RLS_WORDS(4)];

thetahat_error start(thetahat_rls **rls, const thetahat_number *scales) {
    thetahat_learning learning = {};
    learning.forgetting = THETAHAT_FORGETTING_SELECTIVE;
    learning.factor = thetahat_number(0.99);
    return thetahat_rls_init(rls, memory, sizeof memory, &thetahat_rls_4, scales, &learning);
}
