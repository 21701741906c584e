/* Every size: the memory that the header says is enough, and hardly more than enough. */
#include "done.h"

/* A word less for each: by so many bytes a macro may be above what is needed. */
#define SLACK 96

static thetahat_word memory[4096];
static const thetahat_number numbers[256] = {1};
static thetahat_number ones[16];
static thetahat_rst_law law;
static int count;

static void check(const char *name, size_t words, thetahat_error enough, thetahat_error too_little) {
    count++;
    if (enough != THETAHAT_ERROR_NONE || too_little != THETAHAT_ERROR_MEMORY_TOO_SMALL) {
        printf("%s, %lu words: %s, %s\n", name, (unsigned long)words, thetahat_error_name(enough),
               thetahat_error_name(too_little));
        exit(1);
    }
}

/* WORDS words are enough for an object that INIT makes, with less than SLACK bytes less they are not. */
#define CHECK(NAME, WORDS, INIT) \
    do { \
        size_t words = WORDS, bytes = words * sizeof(thetahat_word); \
        thetahat_error enough = INIT; \
        bytes = bytes > SLACK ? bytes - SLACK : 0; \
        check(NAME, words, enough, INIT); \
    } while (0)

#define RLS(n) CHECK("rls " #n, THETAHAT_RLS_WORDS(n), thetahat_rls_init(&rls, memory, bytes, &thetahat_rls_##n, ones, NULL))

static thetahat_error init_arx(size_t bytes, const thetahat_arx_size *size, uint32_t na, uint32_t nc) {
    thetahat_arx_model model = {0};
    thetahat_arx *arx;
    model.na = na;
    model.nc = nc;
    model.output_scale = 1;
    model.noise_scale = 1;
    return thetahat_arx_init(&arx, memory, bytes, size, &model, NULL);
}

#define ARX(n) CHECK("arx " #n, THETAHAT_ARX_WORDS(n), init_arx(bytes, &thetahat_arx_##n, n, 0))
#define ARMAX(n) CHECK("armax " #n, THETAHAT_ARMAX_WORDS(n), init_arx(bytes, &thetahat_armax_##n, n - 1, 1))

#define FILTERS(n, m) \
    CHECK("kalman " #n " " #m, THETAHAT_KALMAN_WORDS(n, m), \
          thetahat_kalman_init(&kalman, memory, bytes, &thetahat_kalman_##n##_##m, numbers, NULL)); \
    CHECK("ekf " #n " " #m, THETAHAT_EKF_WORDS(n, m), \
          thetahat_ekf_init(&ekf, memory, bytes, &thetahat_ekf_##n##_##m, numbers, NULL)); \
    CHECK("ukf " #n " " #m, THETAHAT_UKF_WORDS(n, m), \
          thetahat_ukf_init(&ukf, memory, bytes, &thetahat_ukf_##n##_##m, numbers, NULL)); \
    CHECK("luenberger " #n " " #m, THETAHAT_LUENBERGER_WORDS(n, m), \
          thetahat_luenberger_init(&luenberger, memory, bytes, &thetahat_luenberger_##n##_##m, numbers, NULL))

#define RST(n) \
    CHECK("rst " #n, THETAHAT_RST_WORDS(n), \
          thetahat_rst_init(&rst, memory, bytes, &thetahat_rst_##n, &law)); \
    place(&thetahat_rst_place_##n, n)

static thetahat_error init_tuner(size_t bytes, const thetahat_tuner_size *size) {
    thetahat_tuner_wish wish;
    thetahat_tuner *tuner;
    done("usual", thetahat_tuner_usual(&wish, 1, 1, -1, 1));
    return thetahat_tuner_init(&tuner, memory, bytes, size, &wish, NULL);
}

#define INDIRECT(na, nb) \
    CHECK("indirect " #na " " #nb, THETAHAT_INDIRECT_WORDS(na, nb), init_tuner(bytes, &thetahat_indirect_##na##_##nb))
#define DIRECT(na, nb, d) \
    CHECK("direct " #na " " #nb " " #d, THETAHAT_DIRECT_WORDS(na, nb, d), \
          init_tuner(bytes, &thetahat_direct_##na##_##nb##_##d))

/* A pure delay of n samples has a controller with n coefficients. */
static void place(const thetahat_rst_place_size *size, size_t n) {
    const thetahat_number one[1] = {1};
    thetahat_number b[16] = {0};
    thetahat_rst_poles poles = {one, 1, one, 1, 1, 0};
    b[n] = 1;
    done("place", thetahat_rst_place(size, one, 1, b, n + 1, &poles, &law));
}

int main(void) {
    thetahat_rls *rls;
    thetahat_kalman *kalman;
    thetahat_ekf *ekf;
    thetahat_ukf *ukf;
    thetahat_luenberger *luenberger;
    thetahat_rst *rst;
    thetahat_detector *detector;
    for (int i = 0; i < 16; i++) {
        ones[i] = 1;
    }
    RLS(1); RLS(2); RLS(3); RLS(4); RLS(5); RLS(6); RLS(7); RLS(8);
    RLS(9); RLS(10); RLS(11); RLS(12); RLS(13); RLS(14); RLS(15); RLS(16);
    ARX(1); ARX(2); ARX(3); ARX(4); ARX(5); ARX(6); ARX(7); ARX(8); ARX(9); ARX(10); ARX(11); ARX(12);
    ARMAX(1); ARMAX(2); ARMAX(3); ARMAX(4); ARMAX(5); ARMAX(6);
    ARMAX(7); ARMAX(8); ARMAX(9); ARMAX(10); ARMAX(11); ARMAX(12);
    FILTERS(1, 1); FILTERS(2, 1); FILTERS(2, 2); FILTERS(3, 1); FILTERS(3, 2); FILTERS(3, 3);
    FILTERS(4, 1); FILTERS(4, 2); FILTERS(4, 3); FILTERS(5, 1); FILTERS(5, 2); FILTERS(5, 3);
    FILTERS(6, 1); FILTERS(6, 2); FILTERS(6, 3);
    RST(1); RST(2); RST(3); RST(4); RST(5); RST(6); RST(7); RST(8); RST(9); RST(10); RST(11); RST(12);
    INDIRECT(1, 1); INDIRECT(1, 2); INDIRECT(1, 3); INDIRECT(1, 4);
    INDIRECT(2, 2); INDIRECT(2, 3); INDIRECT(2, 4); INDIRECT(2, 5); INDIRECT(3, 3); INDIRECT(3, 4);
    DIRECT(1, 1, 1); DIRECT(1, 1, 2); DIRECT(1, 1, 3); DIRECT(2, 1, 1); DIRECT(2, 2, 1); DIRECT(2, 2, 2); DIRECT(2, 2, 3);
    CHECK("detector", THETAHAT_DETECTOR_WORDS, thetahat_detector_init(&detector, memory, bytes, 4, 4));
    printf("%d sizes\n", count);
    return 0;
}
