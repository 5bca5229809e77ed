/* Transmission engaging model (src/friction_fmu/tem.c) against its definition. */
#include "check.h"
#include "tem.h"

static const double W = 0.04;

static void position_is_clipped(void) {
    CHECK_NEAR(tem_advance(0, 0.01, W), 0.01, 0);
    CHECK_NEAR(tem_advance(0.015, 0.01, W), 0.02, 0);
    CHECK_NEAR(tem_advance(-0.015, -0.01, W), -0.02, 0);
    CHECK_NEAR(tem_advance(0.02, -0.05, W), -0.02, 0); /* a step larger than the zone */
    CHECK_NEAR(tem_advance(0.02, 0, W), 0.02, 0);
    CHECK_NEAR(tem_advance(0, 5, 0), 0, 0);
    /* Eq. 4 is play: after a reversal it takes W of travel, no less, until the other end is reached. */
    double c = tem_advance(0, 1, W);
    for (int i = 0; i < 8; i++) {
        CHECK(c > -W / 2);
        c = tem_advance(c, -W / 8, W);
    }
    CHECK_NEAR(c, -W / 2, 1e-17); /* eight roundings of 0.04 */
}

static void engagement(void) {
    CHECK_NEAR(tem_engagement(1e-3, 0, W), 0.5, 0);
    CHECK_NEAR(tem_engagement(1e-3, W / 2, W), 1, 0);
    CHECK_NEAR(tem_engagement(1e-3, -W / 2, W), 0, 0);
    CHECK_NEAR(tem_engagement(-1e-3, W / 2, W), 0, 0);
    CHECK_NEAR(tem_engagement(-1e-3, -W / 2, W), 1, 0);
    CHECK_NEAR(tem_engagement(0, W / 4, W), 0.75, 1e-16);
    CHECK_NEAR(tem_engagement(-1e-3, W / 4, W), 0.25, 1e-16);
    CHECK_NEAR(tem_engagement(1e-3, 0, 0), 1, 0); /* switched off: no 0/0 */
    CHECK_NEAR(tem_engagement(-1e-3, 0, 0), 1, 0);
}

static void share(void) {
    for (double gamma = 0; gamma <= 1; gamma += 0.05) { /* ends exact whatever gamma's rounding */
        CHECK_NEAR(tem_share(0, gamma), gamma, 0);
        CHECK_NEAR(tem_share(1, gamma), 1, 0);
    }
    CHECK_NEAR(tem_share(0.5, 0.35), 0.675, 1e-16);
}

int main(void) {
    position_is_clipped();
    engagement();
    share();
    return CHECK_RESULT;
}
