#include "mount.h"

#include <math.h>
#include <stdbool.h>

double mount_friction(const Mount *mount, const MountState *state, double x) {
    const double d = x - state->x_s, F_s = state->F_s, F_max = mount->F_max;
    if (!(F_max > 0)) {
        return 0;
    }
    return d > 0 ? F_s + d / (mount->x_2 * (1 - F_s / F_max) + d) * (F_max - F_s)
                 : F_s + d / (mount->x_2 * (1 + F_s / F_max) - d) * (F_max + F_s);
}

void mount_move(const Mount *mount, MountState *state, double x) {
    if ((x - state->x) * (state->x - state->x_s) < 0) {
        state->F_s = mount_friction(mount, state, state->x);
        state->x_s = state->x;
    }
    state->x = x;
}

/* Reversals within a step, on the cubic through its ends: speed at the share s of it v_0 + b s + a s^2. */
static void mount_reverse(const Mount *mount, MountState *state, double mean, double v_0, double v_1, double h) {
    const double x_0 = state->x, a = 3 * (v_0 + v_1 - 2 * mean), b = 2 * (3 * mean - 2 * v_0 - v_1);
    const double root = b * b - 4 * a * v_0;
    if (!(root > 0)) {
        return;
    }
    const double q = -(b + copysign(sqrt(root), b)) / 2;
    double s[2] = {q / a, v_0 / q}; /* no number, or none within the step, where there is none */
    if (s[1] < s[0]) {
        const double later = s[0];
        s[0] = s[1];
        s[1] = later;
    }
    for (int i = 0; i < 2; i++) {
        if (s[i] > 0 && s[i] < 1) {
            mount_move(mount, state, x_0 + h * s[i] * (v_0 + s[i] * (b / 2 + s[i] * a / 3)));
        }
    }
}

static double mount_relaxed(const Mount *mount, double h) {
    return -expm1(-h * mount->K_v / mount->c);
}

void mount_prepare(Mount *mount, double h) {
    mount->h = h;
    mount->relaxed = mount_relaxed(mount, h);
}

void mount_advance(const Mount *mount, MountState *state, double x, double v_0, double v_1, double h) {
    const double mean = (x - state->x) / h;
    /* A cubic whose speeds at the ends are between 0 and three times the mean turns nowhere. */
    const bool onward = mean > 0 ? v_0 >= 0 && v_1 >= 0 && v_0 <= 3 * mean && v_1 <= 3 * mean
                                 : v_0 <= 0 && v_1 <= 0 && v_0 >= 3 * mean && v_1 >= 3 * mean;
    if (!onward && mount->F_max > 0) {
        mount_reverse(mount, state, mean, v_0, v_1, h);
    }
    mount_move(mount, state, x);
    if (mount->K_v > 0 && mount->c > 0) {
        state->F_v += (mount->c * mean - state->F_v) * (h == mount->h ? mount->relaxed : mount_relaxed(mount, h));
    }
}

double mount_force(const Mount *mount, const MountState *state) {
    return mount->K_e * state->x + mount_friction(mount, state, state->x) + state->F_v;
}
