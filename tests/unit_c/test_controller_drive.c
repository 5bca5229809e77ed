/* The cascade of the controller: order of the blocks, instants, computing delay. */
#include "check.h"
#include "drive.h"

#define LINES 64

static const double T_C = 125e-6;

/* Z axis of the synthetic default machine, without filter. */
static Drive z_drive(bool ideal_current_loop) {
    const PositionParameters position = {
        .T_pos = 1e-3, .I_P = 0.003, .K_v = 60.0, .k_ffw = 1.0, .T_dyn = 1.326e-3, .T_sym = 3.528e-3};
    Drive p = {.T_c = T_C, .ticks = 8, .K_t = 2.0, .ideal_current_loop = ideal_current_loop};
    p.position = position_of(&position);
    p.ramp = (SetpointRamp){.ticks = 8, .ramped = true};
    p.reference_model = reference_model_of(true, 915.3, 1.214, 2.5 * T_C, T_C);
    p.speed = speed_of(6.18, 0.012, false, 80.0, T_C);
    p.current = current_of(17.28, 0.011, 350.0, T_C);
    p.motor = (Pmsm){.R = 0.45, .L_d = 5e-3, .L_q = 5e-3, .psi = pmsm_flux_linkage(2.0, 5.0), .p = 5.0};
    drive_layout(&p);
    CHECK(p.samples <= LINES);
    return p;
}

static void delay_lines_do_not_overlap(void) {
    Drive p = z_drive(true);
    CHECK(p.x_ring == 0);
    CHECK(p.n_ring == 7);          /* 4.854 samples: ages 3 to 6 */
    CHECK(p.reference_ring == 11); /* 1.326 samples: ages 0 to 3 */
    CHECK(p.samples == 15);        /* 2.5 samples: ages 2 and 3 */
}

static void voltage_acts_a_cycle_later(void) {
    Drive p = z_drive(false);
    DriveState x = {.instant = 0};
    double lines[LINES];
    const DriveInputs in = {.x_s = 0.1, .x_a = 0.1, .M_add = 5.0, .release = true};
    drive_instant(&p, &x, lines, &in); /* t_0: current setpoint 2.5 A, first voltage computed */
    double u_q = 17.28 * (1.0 + T_C / 0.011) * 2.5;
    CHECK_NEAR(x.M_s, 5.0, 1e-11); /* x_s through the weights of the delay: an ulp of 0.1, times K_p K_v/I_P */
    CHECK(x.u_q == 0.0 && x.right.M_a == 0.0);
    drive_instant(&p, &x, lines, &in); /* t_1: it acts until t_2 */
    double i_q = u_q / 0.45 * -expm1(-0.45 / 5e-3 * T_C);
    CHECK_NEAR(x.u_q, u_q, 1e-10);
    CHECK(x.left.M_a == 0.0);
    CHECK_NEAR(x.right.M_a, 2.0 * i_q, 1e-11);
    double before = x.right.M_a;
    drive_instant(&p, &x, lines, &in);
    CHECK(x.left.M_a == before && x.right.M_a > before);
}

static void ideal_current_loop_acts_at_once(void) {
    Drive p = z_drive(true);
    DriveState x = {.instant = 0};
    double lines[LINES];
    for (int k = 0; k < 20; ++k) {
        const DriveInputs in = {.n_add = k, .n_a = 0.5 * k, .M_add = 1.0, .release = true};
        drive_instant(&p, &x, lines, &in);
        CHECK_NEAR(x.right.M_a, 6.18 * 0.5 * k + 1.0, 1e-13); /* P controller on this very instant's speeds */
        CHECK(x.left.M_a == x.right.M_a);                     /* held over the cycle */
        CHECK(x.right.i.i_q == x.right.M_a / 2.0 && x.right.i.i_d == 0.0 && x.u_q == 0.0);
    }
}

static void position_works_every_eighth_instant(void) {
    Drive p = z_drive(true);
    DriveState x = {.instant = 0};
    double lines[LINES];
    for (int k = 0; k < 24; ++k) {
        const DriveInputs in = {.x_a = -1e-6 * k, .release = true};
        drive_instant(&p, &x, lines, &in);
        CHECK_NEAR(x.position.x_e, 1e-6 * (k / 8) * 8, 1e-21);
        /* from the value of the cycle before to this one's, reached in the last tick */
        double step = 60.0 * 8e-6 / 0.003;
        double n_s = k < 8 ? 0.0 : step * (k / 8 - 1) + step * (k % 8 + 1) / 8.0;
        CHECK_NEAR(x.n_s, n_s, 1e-15);
    }
    CHECK(x.instant == 24 && x.tick == 0);
}

/* Without release the torque is gone at the end of the cycle, and the motor's voltage is what it induces. */
static void no_torque_without_release(void) {
    Drive p = z_drive(false);
    DriveState x = {.instant = 0};
    double lines[LINES];
    DriveInputs in = {.x_s = 0.1, .x_a = 0.1, .n_a = 20.0, .M_add = 5.0, .release = true};
    for (int k = 0; k < 5; ++k) {
        drive_instant(&p, &x, lines, &in);
    }
    const double before = x.right.M_a;
    CHECK(before != 0.0);
    in.release = false;
    in.x_a = 0.0998;
    drive_instant(&p, &x, lines, &in);
    CHECK(x.left.M_a == before && x.right.M_a == 0.0 && x.right.i.i_d == 0.0 && x.right.i.i_q == 0.0);
    CHECK_NEAR(x.u_q, 5.0 * 20.0 * p.motor.psi, 1e-12);
    CHECK(x.n_s == 0.0 && x.n_ref == 0.0 && x.M_s == 0.0 && x.speed.I == 0.0 && x.current.I_q == 0.0);
    CHECK(x.position.x_e == 0.1 - 0.0998);
    drive_instant(&p, &x, lines, &in);
    CHECK(x.left.M_a == 0.0 && x.right.M_a == 0.0);
    CHECK(x.instant == 7 && x.tick == 7); /* the grid goes on */

    Drive ideal = z_drive(true);
    DriveState y = {.instant = 0};
    in.release = true;
    drive_instant(&ideal, &y, lines, &in);
    CHECK(y.right.M_a != 0.0);
    in.release = false;
    drive_instant(&ideal, &y, lines, &in);
    CHECK(y.left.M_a == 0.0 && y.right.M_a == 0.0 && y.u_q == 0.0); /* jumps at t_k, as it always does */
}

/* After a release the drive does what one does that starts there, however it had been stirred before. */
static void release_forgets_what_was(void) {
    Drive p = z_drive(false);
    p.measured_speed = measured_speed_of(3, T_C, 0.003);
    drive_layout(&p);
    CHECK(p.samples <= LINES);
    DriveState x = {.instant = 0}, fresh = {.instant = 0};
    double lines[LINES], fresh_lines[LINES];
    DriveInputs in = {.x_s = 0.1, .x_a = 0.1, .release = true};
    for (int k = 0; k < 53; ++k) { /* ends within a position cycle */
        in.x_s = 0.1 + 1e-5 * k;
        in.n_ffw = 3.0 * k;
        in.n_add = 1.0;
        in.release = k < 45;
        drive_instant(&p, &x, lines, &in);
    }
    CHECK(x.instant == 53 && x.tick == 5);
    in = (DriveInputs){.x_s = 0.2, .n_ffw = 7.0, .x_a = 0.1, .release = true};
    fresh.tick = 5;
    for (int k = 0; k < 100; ++k) {
        in.x_s += 1e-6;
        drive_instant(&p, &x, lines, &in);
        drive_instant(&p, &fresh, fresh_lines, &in);
        CHECK(x.right.M_a == fresh.right.M_a && x.n_s == fresh.n_s && x.n_ref == fresh.n_ref);
        CHECK(x.position.x_e == fresh.position.x_e);
        CHECK(x.speed.I == fresh.speed.I && x.current.I_q == fresh.current.I_q);
    }
    CHECK(fresh.right.M_a != 0.0);
}

/* The encoder goes on measuring: a turning motor is not taken for one at rest when the release comes back. */
static void position_is_measured_without_release(void) {
    Drive p = z_drive(true);
    p.measured_speed = measured_speed_of(3, T_C, 0.003);
    drive_layout(&p);
    DriveState x = {.instant = 0};
    double lines[LINES];
    const double n = 10.0; /* rad/s */
    for (int k = 0; k < 30; ++k) {
        const double place = 0.003 * n * T_C * k;
        const DriveInputs in = {.x_s = place, .x_a = place, .release = k < 8 || k >= 24};
        drive_instant(&p, &x, lines, &in);
        if (k == 24) {
            CHECK_NEAR(x.M_s, -6.18 * n, 1e-9);
        }
    }
    /* Ahead of the first release there is none of it: importers may show anything then. */
    DriveState y = {.instant = 0};
    DriveInputs in = {.release = false};
    drive_instant(&p, &y, lines, &in);
    in = (DriveInputs){.x_s = 0.1, .x_a = 0.1, .release = true};
    drive_instant(&p, &y, lines, &in);
    CHECK_NEAR(y.M_s, 0.0, 1e-11);
}

int main(void) {
    delay_lines_do_not_overlap();
    voltage_acts_a_cycle_later();
    ideal_current_loop_acts_at_once();
    position_works_every_eighth_instant();
    no_torque_without_release();
    release_forgets_what_was();
    position_is_measured_without_release();
    return CHECK_RESULT;
}
