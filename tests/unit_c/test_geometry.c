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
    errors_are_polynomials_with_their_slopes();
    return CHECK_RESULT;
}
