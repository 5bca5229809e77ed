/* Play of a drive and errors of guides. */
#include "check.h"
#include "geometry.h"

static void play_is_used_up_before_the_slide_moves(void) {
    const double b = 8e-6;
    double y = 0;
    for (int k = 0; k <= 100; k++) { /* up: half of it is free at the start */
        y = geometry_play(y, k * 1e-6, b);
        CHECK_NEAR(y, k <= 4 ? 0 : (k - 4) * 1e-6, 1e-19);
    }
    for (int k = 100; k >= 0; k--) { /* back: all of it */
        y = geometry_play(y, k * 1e-6, b);
        CHECK_NEAR(y, k >= 92 ? 96e-6 : (k + 4) * 1e-6, 1e-19);
    }
    CHECK_EQUAL(geometry_play(5.0, 3.0, 0), 3.0);
}

/* h over 2 w of way, and none beyond. */
static void hysteresis_winds_up_over_its_way(void) {
    const double w = 50e-6;
    double e = 0;
    for (int k = 1; k <= 100; k++) {
        e = geometry_hysteresis(e, 1e-6, w);
        CHECK_NEAR(e, k <= 50 ? k * 1e-6 : w, 1e-18);
    }
    for (int k = 1; k <= 150; k++) { /* back: twice the way until it slips */
        e = geometry_hysteresis(e, -1e-6, w);
        CHECK_NEAR(e, k <= 100 ? w - k * 1e-6 : -w, 1e-18);
    }
}

/* What a small rotation does to an arm: angle x arm. */
static void angles_act_by_their_arms(void) {
    Geometry p = {.linear = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}};
    const double first[3] = {1e-5, 2e-5, -3e-5}, second[3] = {1e-4, 0, 2e-4}, r[3] = {0.1, -0.2, 0.4};
    const double s[3] = {0, 0.3, 0};
    double error[3];
    geometry_arms(&p, 1, first, second, r);
    geometry_errors(&p, s, error);
    const double a = 0.3 * 1e-5 + 0.09 * 1e-4, b = 0.3 * 2e-5, c = -0.3 * 3e-5 + 0.09 * 2e-4;
    CHECK_NEAR(error[0], b * r[2] - c * r[1], 1e-19);
    CHECK_NEAR(error[1], c * r[0] - a * r[2], 1e-19);
    CHECK_NEAR(error[2], a * r[1] - b * r[0], 1e-19);
}

static void errors_are_polynomials_with_their_slopes(void) {
    const Geometry p = {.linear = {{1e-5, 2e-5, 5e-5}, {0, -1e-5, 3e-5}, {0, 0, 4e-5}},
                        .second = {{0, 1e-4, 0}, {0, 0, -2e-4}, {3e-4, 0, 0}},
                        .third = {{0, 0, 1e-3}, {2e-3, 0, 0}, {0, -1e-3, 0}}};
    const double s[3] = {0.1, -0.2, 0.05}, v[3] = {0.3, 0.1, -0.2}, h = 1e-6;
    double error[3], slope[3], ahead[3], behind[3];
    geometry_errors(&p, s, error);
    CHECK_NEAR(error[0], 1e-6 - 4e-6 + 2.5e-6 + 4e-6 + 1.25e-7, 1e-19);
    CHECK_NEAR(error[1], 2e-6 + 1.5e-6 - 5e-7 + 2e-6, 1e-19);
    CHECK_NEAR(error[2], 2e-6 + 3e-6 + 8e-6, 1e-19);
    geometry_slopes(&p, s, v, slope);
    const double later[3] = {s[0] + h * v[0], s[1] + h * v[1], s[2] + h * v[2]};
    const double before[3] = {s[0] - h * v[0], s[1] - h * v[1], s[2] - h * v[2]};
    geometry_errors(&p, later, ahead);
    geometry_errors(&p, before, behind);
    for (int d = 0; d < 3; d++) {
        CHECK_NEAR(slope[d], (ahead[d] - behind[d]) / (2 * h), 1e-13); /* third order: h^2; rounding: 1e-21/h */
    }
}

int main(void) {
    play_is_used_up_before_the_slide_moves();
    hysteresis_winds_up_over_its_way();
    angles_act_by_their_arms();
    errors_are_polynomials_with_their_slopes();
    return CHECK_RESULT;
}
