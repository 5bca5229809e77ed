#include "mount.h"

#include <math.h>

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

void mount_advance(const Mount *mount, MountState *state, double x, double v_0, double v_1, double h) {
    /* The speed on the cubic, at the share s of the step: v_0 + b s + a s^2. */
    const double x_0 = state->x, mean = (x - x_0) / h, a = 3 * (v_0 + v_1 - 2 * mean);
    const double b = 2 * (3 * mean - 2 * v_0 - v_1), root = b * b - 4 * a * v_0;
    if (root > 0 && mount->F_max > 0) {
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
    mount_move(mount, state, x);
    if (mount->K_v > 0 && mount->c > 0) {
        state->F_v += (mount->c * mean - state->F_v) * -expm1(-h * mount->K_v / mount->c);
    }
}

double mount_force(const Mount *mount, const MountState *state) {
    return mount->K_e * state->x + mount_friction(mount, state, state->x) + state->F_v;
}
