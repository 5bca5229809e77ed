/* The path planner (src/planner): what must hold of any motion along zones, and whole programs for the sanitisers. */
#include <math.h>
#include <stdlib.h>

#include "check.h"
#include "planner.h"
#include "speed.h"

static double uniform(double low, double high) {
    static unsigned long long state = 88172645463325252ull;
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return low + (high - low) * (double)(state >> 11) / 9007199254740992.0;
}

/* --- the motion along random zones */

enum { ZONES = 40 };

static void check_tops(const Speed *speed) {
    double since = -HUGE_VAL; /* when acceleration ended */
    bool rising = false;
    for (size_t k = 0; k < speed->phases; k++) {
        const Phase *p = &speed->phase[k];
        const Phase *next = p + 1;
        CHECK_NEAR(p->s + (next->t - p->t) * (p->v + (next->t - p->t) * p->a / 2), next->s, 1e-12);
        CHECK_NEAR(p->v + (next->t - p->t) * p->a, next->v, 1e-12);
        if (p->a > 0) {
            rising = true;
            since = next->t;
        } else if (p->a < 0) {
            CHECK(!rising || p->t - since >= speed->T * (1 - 1e-9));
            rising = false;
        }
    }
}

/* In every zone the mean keeps the zone's speed, acceleration, and acceleration over T. */
static void check_mean(const Stretch *stretch, const Speed *speed) {
    size_t hint[2] = {0, 0};
    double q[4], worst[3] = {0, 0, 0};
    size_t k = 0;
    for (int at = 0; at <= 3000; at++) {
        const double t = speed->duration * at / 3000;
        motion_at(speed, t, hint, q);
        while (k + 1 < stretch->count && stretch->zone[k].q + stretch->zone[k].length < q[0]) {
            k++;
        }
        if (fabs(q[0] - stretch->zone[k].q) > 1e-9 &&
            fabs(q[0] - stretch->zone[k].q - stretch->zone[k].length) > 1e-9) {
            worst[0] = fmax(worst[0], q[1] / speed->V[k]);
            worst[1] = fmax(worst[1], fabs(q[2]) / speed->A[k]);
            worst[2] = fmax(worst[2], fabs(q[3]) * speed->T / speed->A[k]);
        }
    }
    CHECK(worst[0] <= 1 + 1e-9);
    CHECK(worst[1] <= 1 + 1e-9);
    CHECK(worst[2] <= 1 + 1e-9);
    CHECK_NEAR(q[0], stretch->q1, 1e-12);
    motion_at(speed, 0, hint, q);
    CHECK_NEAR(q[0], 0, 1e-15);
    for (int at = 0; at < 50; at++) {
        const double place = uniform(0, stretch->q1);
        motion_at(speed, time_at(speed, place, hint), hint, q);
        CHECK_NEAR(q[0], place, 1e-11);
    }
}

static void test_random_zones(void) {
    const Program program = {.axes = 1};
    Speed speed = {0};
    for (int trial = 0; trial < 200; trial++) {
        Zone zone[ZONES] = {0};
        double q = 0;
        for (int k = 0; k < ZONES; k++) {
            zone[k].q = q;
            zone[k].length = pow(10, uniform(-5, -1.5));
            q += zone[k].length;
            for (int b = 0; b < BOUND_COUNT; b++) {
                zone[k].V[b] = HUGE_VAL;
            }
            zone[k].V[BOUND_SPEED] = pow(10, uniform(-3, 0));
            zone[k].a_line = pow(10, uniform(-1, 1));
            zone[k].j_line = zone[k].a_path = zone[k].j_path = HUGE_VAL;
        }
        const Stretch stretch = {.program = &program,
                                 .zone = zone,
                                 .count = ZONES,
                                 .q1 = q,
                                 .T = pow(10, uniform(-3, -0.7)),
                                 .share = 0.5,
                                 .soft = true};
        CHECK(plan_speed(&stretch, &speed) == 1);
        check_tops(&speed);
        check_mean(&stretch, &speed);
    }
    speed_free(&speed);
}

/* --- whole programs */

enum { ROWS = 300, AXES = 2 };

static void test_program(int8_t blending, int8_t compressed, int8_t arcs) {
    static double end[ROWS * AXES], centre[ROWS * 3], normal[ROWS * 3], angle[ROWS], feed[ROWS], dwell[ROWS];
    static double tolerance[ROWS], start_time[ROWS], end_time[ROWS];
    static int8_t motion[ROWS], blendings[ROWS], soft[ROWS], joined[ROWS], kind[ROWS], axis[ROWS];
    const double start[AXES] = {0, 0}, speed[AXES] = {1, 1}, acceleration[AXES] = {2, 3}, jerk[AXES] = {30, HUGE_VAL};
    const double jump[AXES] = {5e-3, 7e-3};
    double x = 0, y = 0, heading = 0;
    for (int k = 0; k < ROWS; k++) {
        heading += k % 40 ? uniform(-0.2, 0.2) : 2;
        const double step = uniform(1e-5, 3e-4);
        const double cosine = cos(heading), sine = sin(heading);
        motion[k] = (int8_t)(k == 150 ? 3 : arcs && k % 3 == 0 ? 2 : 1);
        if (motion[k] == 2) { /* half a turn about a point on the left */
            centre[3 * k] = x - step * sine;
            centre[3 * k + 1] = y + step * cosine;
            normal[3 * k + 2] = 1;
            angle[k] = 3.14159265358979;
            x -= 2 * step * sine;
            y += 2 * step * cosine;
            heading += angle[k];
        } else if (motion[k] == 1 && k % 50) {
            x += step * cosine;
            y += step * sine;
        }
        end[AXES * k] = x;
        end[AXES * k + 1] = y;
        feed[k] = 0.05;
        dwell[k] = motion[k] == 3 ? 0.1 : 0;
        tolerance[k] = 5e-5;
        blendings[k] = k % 97 ? blending : 0;
        soft[k] = k < 250;
        joined[k] = compressed;
    }
    const Program program = {
        .rows = ROWS,
        .axes = AXES,
        .space_x = 0,
        .space_y = 1,
        .space_z = -1,
        .start = start,
        .motion = motion,
        .end = end,
        .centre = centre,
        .normal = normal,
        .angle = angle,
        .feed = feed,
        .dwell = dwell,
        .blending = blendings,
        .tolerance = tolerance,
        .jerk_limited = soft,
        .compressed = joined,
        .max_speed = speed,
        .max_acceleration = acceleration,
        .max_jerk = jerk,
        .speed_jump = jump,
        .path_acceleration = HUGE_VAL,
        .path_jerk = HUGE_VAL,
        .step_time = 2e-3,
        .grid = 2e-3,
        .split_angle = 0.5,
        .short_block = 20e-3,
        .spline_tolerance = 5e-6,
        .start_time = start_time,
        .end_time = end_time,
        .limit_kind = kind,
        .limit_axis = axis,
    };
    Planner *planner = planner_create(&program);
    CHECK(planner != NULL);
    int64_t rows = 0, corners = 0;
    int state = PLANNER_MORE;
    while (state == PLANNER_MORE) {
        state = planner_advance(planner, &rows);
    }
    CHECK(state == PLANNER_DONE && rows == ROWS);
    double saved[2];
    const double duration = planner_duration(planner, saved, &corners);
    CHECK(duration > 0.1);
    for (int k = 0; k < ROWS; k++) {
        CHECK(end_time[k] >= start_time[k] && (k == 0 || start_time[k] >= end_time[k - 1] - 1e-12));
        CHECK(kind[k] >= 0 && kind[k] <= 5 && axis[k] >= -1 && axis[k] < AXES);
    }
    enum { INSTANTS = 500 };
    static double t[INSTANTS], at[INSTANTS * AXES], s[INSTANTS], q[INSTANTS * 5], v[INSTANTS * AXES];
    static int64_t row[INSTANTS];
    for (int k = 0; k < INSTANTS; k++) {
        t[k] = duration * k / (INSTANTS - 1);
    }
    CHECK(planner_sample(planner, INSTANTS, t, at, row, s, v, NULL, NULL, q) == PLANNER_DONE);
    CHECK_NEAR(at[INSTANTS * AXES - 2], x, 1e-12);
    CHECK_NEAR(at[INSTANTS * AXES - 1], y, 1e-12);
    for (int k = 0; k < INSTANTS; k++) {
        CHECK(row[k] >= 0 && row[k] < ROWS && (k == 0 || (row[k] >= row[k - 1] && s[k] >= s[k - 1] - 1e-12)));
        CHECK(fabs(v[2 * k]) <= 1 && fabs(v[2 * k + 1]) <= 1);
    }
    /* backwards: each instant by itself gives the same */
    double alone[AXES];
    for (int k = INSTANTS - 1; k >= 0; k -= 7) {
        CHECK(planner_sample(planner, 1, t + k, alone, NULL, NULL, NULL, NULL, NULL, NULL) == PLANNER_DONE);
        CHECK_NEAR(alone[0], at[AXES * k], 1e-13);
        CHECK_NEAR(alone[1], at[AXES * k + 1], 1e-13);
    }
    planner_destroy(planner);
}

int main(void) {
    test_random_zones();
    for (int8_t blending = 0; blending < 4; blending++) {
        for (int8_t compressed = 0; compressed < 2; compressed++) {
            test_program(blending, compressed, 0);
            test_program(blending, compressed, 1);
        }
    }
    return CHECK_RESULT;
}
