/* Friction at guides, solved together with masses that they hold: closed forms of a mass under a constant force. */
#include "check.h"
#include "guide.h"

static const double M = 400, P = 900; /* kg, N */
static bool settled;

static Guide guide_of(double sigma_2) {
    return (Guide){.on = true,
                   .contact = {.lugre = {.sigma_0 = 3e7,
                                         .sigma_1 = 0,
                                         .sigma_2 = sigma_2,
                                         .F_C = 500,
                                         .F_S = 650,
                                         .v_s = 2e-3,
                                         .beta = 1,
                                         .v_log = 1},
                               .W = 0,
                               .gamma = 1}};
}

/* A free mass under a constant force from rest on. */
static GuideState pushed(Guide guide, double force, double h, int steps, double *v) {
    const double held = h / M, ramp = h / (2 * M);
    GuideState state = {{0, 0}, 0, 0, 0, 0, 0, 0}, end = state;
    for (int k = 0; k < steps; k++) {
        const double v_free = state.v + force * h / M;
        CHECK(guide_step(1, &guide, &v_free, &held, &ramp, &state, &end, h, &settled));
        state = end;
    }
    *v = state.v;
    return state;
}

static void steady_speed_is_that_of_the_balance(void) {
    double v;
    const Guide guide = guide_of(2000);
    const GuideState state = pushed(guide, P, 125e-6, 48000, &v); /* 30 time constants */
    CHECK_NEAR(v, (P - 500) / 2000, 1e-9);                        /* far above v_s: F_C + sigma_2 v */
    CHECK_NEAR(state.F, P, 1e-9 * P);
}

static void below_the_static_force_it_holds_as_a_spring(void) {
    double v;
    const GuideState state = pushed(guide_of(2e5), 300, 125e-6, 24000, &v); /* the viscous part takes the swinging */
    CHECK_NEAR(state.F, 300, 1e-6 * 300);
    CHECK_NEAR(v, 0, 1e-9);
}

/* sigma_2 h / M = 300: an exchange that knows the speed of the step before would burst here. */
static void stiff_guides_set_no_limit_to_the_step(void) {
    double v;
    const GuideState state = pushed(guide_of(1e9), P, 125e-6, 4000, &v);
    CHECK_NEAR(state.F, P, 1e-6 * P);
    CHECK(v > 0 && v <= P / 1e9 * 1.001);
}

static void halved_steps_have_a_quarter_of_the_error(void) {
    double v[4];
    for (int i = 0; i < 4; i++) {
        pushed(guide_of(2000), P, 400e-6 / (1 << i), 500 << i, &v[i]);
    }
    const double first = (v[0] - v[1]) / (v[1] - v[2]), second = (v[1] - v[2]) / (v[2] - v[3]);
    CHECK(first > 3 && first < 5.5);
    CHECK(second > 3 && second < 5.5);
}

static void work_is_what_the_force_gave_and_the_mass_has_not(void) {
    double v;
    const double h = 12.5e-6;
    const int steps = 16000;
    const Guide guide = guide_of(2000);
    const double held = h / M, ramp = h / (2 * M);
    GuideState state = {{0, 0}, 0, 0, 0, 0, 0, 0}, end = state;
    double way = 0;
    for (int k = 0; k < steps; k++) {
        const double v_free = state.v + P * h / M;
        guide_step(1, &guide, &v_free, &held, &ramp, &state, &end, h, &settled);
        way += h * (state.v + end.v) / 2;
        state = end;
    }
    v = state.v;
    CHECK_NEAR(state.work, P * way - M * v * v / 2, 1e-6 * P * way);
}

static void coupled_guides_agree_with_their_forces(void) {
    const double h = 125e-6;
    const Guide guides[3] = {guide_of(2000), {.on = false, .contact = {.W = 0}}, guide_of(5e7)};
    const double held[9] = {h / M, 0, 0.4 * h / M, 0, 1, 0, 0.4 * h / M, 0, h / M};
    double ramp[9];
    for (int i = 0; i < 9; i++) {
        ramp[i] = held[i] / 2;
    }
    GuideState start[3] = {{{0, 0}, 0, 0, 0, 0, 0, 0}, {{0, 0}, 0, 0, 0, 0, 0, 0}, {{0, 0}, 0, 0, 0, 0, 0, 0}}, end[3];
    double v_free[3] = {0.01, 7, -0.02};
    memcpy(end, start, sizeof end);
    CHECK(guide_step(3, guides, v_free, held, ramp, start, end, h, &settled));
    CHECK_EQUAL(end[1].F, 0);
    const double force = contact_torque(&guides[0].contact, end[0].contact, end[0].v, NULL);
    CHECK_NEAR(end[0].F, force, 1e-6 * 650); /* settled to 1e-6 of F_S */
    CHECK(settled);
    for (int i = 0; i < 3; i += 2) {
        const double v = v_free[i] - ramp[3 * i] * end[0].F - ramp[3 * i + 2] * end[2].F;
        CHECK_NEAR(end[i].v, v, 1e-6 * 650 * h / M);
    }
    CHECK(end[0].F > 0 && end[2].F < 0);
}

/* Slides that push one another harder than themselves are no structure: said, and not left at the last of the passes.
 */
static void what_does_not_settle_is_said(void) {
    const double h = 125e-6, held[4] = {h / M, 40 * h / M, 40 * h / M, h / M}, v_free[2] = {0.01, -0.02};
    const Guide guides[2] = {guide_of(5e7), guide_of(5e7)};
    GuideState start[2], end[2];
    memset(start, 0, sizeof start);
    memcpy(end, start, sizeof end);
    CHECK(guide_step(2, guides, v_free, held, held, start, end, h, &settled));
    CHECK(!settled);
}

/* A mass that nothing slows down: the force is that of the place. */
static void friction_follows_the_table_over_position(void) {
    const double h = 125e-6, v = 0.1, held = 0, ramp = 0;
    Guide guide = guide_of(0);
    guide.placed = true;
    guide.place_first = 0.2;
    guide.place_spacing = 0.1;
    guide.place[0] = -0.1;
    guide.place[1] = 0.3;
    guide.place[10] = 0.5;
    const double x[] = {-5, 0.2, 0.25, 0.3, 0.35, 0.75, 1.2, 7};
    const double factor[] = {0.9, 0.9, 1.1, 1.3, 1.15, 1, 1.5, 1.5};
    for (int k = 0; k < 8; k++) {
        GuideState state = {{0, 0}, v, 0, 0, 0, x[k], 0}, end = state;
        for (int step = 0; step < 4000; step++) { /* 50 mm at 0.1 m/s; the place is the caller's */
            CHECK(guide_step(1, &guide, &v, &held, &ramp, &state, &end, h, &settled));
            state = end;
        }
        CHECK_NEAR(state.F, factor[k] * 500, 1e-9 * 500);
    }
}

/* F constant, so that theta = F v/P_w (1 - exp(-t/tau)); and what it makes of the viscous part. */
static void warmth_rises_with_its_time_constant(void) {
    const double h = 0.01, v = 0.1, held = 0, ramp = 0;
    Guide guide = guide_of(0);
    guide.warm_time = 20;
    guide.warm_power = 100;
    GuideState state = {{500 / 3e7, 0}, v, 500, 0, 0, 0, 0}, end = state;
    for (int step = 0; step < 3000; step++) {
        CHECK(guide_step(1, &guide, &v, &held, &ramp, &state, &end, h, &settled));
        state = end;
    }
    CHECK_NEAR(state.warmth, 500 * v / 100 * (1 - exp(-30.0 / 20)), 1e-9);
    guide.contact.lugre.sigma_2 = 2000;
    CHECK(guide_step(1, &guide, &v, &held, &ramp, &state, &end, h, &settled));
    CHECK_NEAR(end.F, 500 + 2000 * v * exp(-state.warmth), 1e-9 * 500);
}

int main(void) {
    steady_speed_is_that_of_the_balance();
    below_the_static_force_it_holds_as_a_spring();
    stiff_guides_set_no_limit_to_the_step();
    halved_steps_have_a_quarter_of_the_error();
    work_is_what_the_force_gave_and_the_mass_has_not();
    coupled_guides_agree_with_their_forces();
    what_does_not_settle_is_said();
    friction_follows_the_table_over_position();
    warmth_rises_with_its_time_constant();
    return CHECK_RESULT;
}
