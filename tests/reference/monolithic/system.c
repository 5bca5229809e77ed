#include "system.h"

#include <math.h>
#include <stddef.h>

double dot(const double *restrict a, const double *restrict b, int count) {
    double sum = 0;
    for (int i = 0; i < count; ++i) {
        sum += a[i] * b[i];
    }
    return sum;
}

static double clip(double value, double limit) {
    return value > limit ? limit : value < -limit ? -limit : value;
}

double motor_speed(const System *s, const State *x, int a) {
    return s->contact[a].J > 0 ? x->motor_n[a] : dot(s->n_port[a], x->v, s->modes);
}

static double contact_torque(const Contact *p, double delta, double rate) {
    return fabs(delta) > p->half ? p->c * (delta - copysign(p->half, delta)) + p->d * rate : 0;
}

static double steady_deflection(const Friction *p, double n) {
    double speed = fabs(n);
    double ratio = speed / p->v_s;
    double stribeck = exp(-(p->beta == 1 ? ratio : pow(ratio, p->beta)));
    double level = p->F_C + (p->F_S - p->F_C) * stribeck + p->F_log * log(speed / p->v_log + 1);
    double side = n > 0 ? 1 + p->asymmetry : n < 0 ? 1 - p->asymmetry : 1;
    return level * side / p->sigma_0;
}

double friction_torque(const Friction *p, double n, double z, double c, double *dz) {
    double rate = n - fabs(n) / steady_deflection(p, n) * z;
    double k = 1;
    if (p->W > 0) {
        double lambda = (p->W / 2 + (z >= 0 ? c : -c)) / p->W;
        k = p->gamma + lambda * (1 - p->gamma);
    }
    if (dz != NULL) {
        *dz = rate;
    }
    return k * p->sigma_0 * z + p->sigma_1 * rate + p->sigma_2 * n;
}

/* Time derivative of the whole state at one Runge-Kutta stage; dq/dt is v and needs no room of its own. */
typedef struct {
    double v[MAX_MODES], z[MAX_AXES], c[MAX_AXES];
    double motor_n[MAX_AXES], delta[MAX_AXES];
    double F_f[MAX_MOUNTS], F_v[MAX_MOUNTS], E[MAX_MOUNTS];
} Rate;

static double mount_force(const Mount *p, const State *x, int m, double speed, Rate *rate, int modes) {
    const double deflection = dot(p->port, x->q, modes), side = x->side[m];
    const double left = p->F_max - side * x->F_f[m], at_reversal = p->F_max - side * x->F_s[m];
    const double force = p->K_e * deflection + x->F_f[m] + x->F_v[m];
    rate->F_f[m] = p->F_max > 0 ? left * left / (at_reversal * at_reversal) * p->F_max / p->x_2 * speed : 0;
    rate->F_v[m] = p->c > 0 ? p->K_v * (speed - x->F_v[m] / p->c) : 0;
    rate->E[m] = force * speed;
    return force - p->K_lin * deflection;
}

static void rate_of(const System *s, const State *x, const double *M_a, Rate *rate) {
    double F[MAX_AXES];
    for (int a = 0; a < s->axes; ++a) {
        const Contact *contact = &s->contact[a];
        double n = motor_speed(s, x, a);
        double c = clip(x->c[a], s->friction[a].W / 2);
        F[a] = M_a[a] - friction_torque(&s->friction[a], n, x->z[a], c, &rate->z[a]);
        rate->motor_n[a] = rate->delta[a] = 0;
        if (contact->J > 0) {
            rate->delta[a] = n - dot(s->n_port[a], x->v, s->modes);
            const double C = contact_torque(contact, x->delta[a], rate->delta[a]);
            rate->motor_n[a] = (F[a] - C) / contact->J;
            F[a] = C;
        }
        F[a] -= s->M_0[a];
        rate->c[a] = n;
    }
    for (int i = 0; i < s->modes; ++i) {
        rate->v[i] = -s->stiffness[i] * x->q[i] - s->damping[i] * x->v[i];
    }
    for (int a = 0; a < s->axes; ++a) {
        for (int i = 0; i < s->modes; ++i) {
            rate->v[i] += s->n_port[a][i] * F[a];
        }
    }
    for (int m = 0; m < s->mounts; ++m) {
        const double *port = s->mount[m].port;
        const double force = mount_force(&s->mount[m], x, m, dot(port, x->v, s->modes), rate, s->modes);
        for (int i = 0; i < s->modes; ++i) {
            rate->v[i] -= port[i] * force;
        }
    }
    for (int a = 0; a < s->axes; ++a) { /* J dn/dt of the structure is no load of it */
        const double J = s->contact[a].J, *port = s->n_port[a];
        if (J > 0) {
            const double more = J * dot(port, rate->v, s->modes) / (1 - J * dot(port, port, s->modes));
            for (int i = 0; i < s->modes; ++i) {
                rate->v[i] += port[i] * more;
            }
        }
    }
}

/* out = x + h * rate, where the rate of q is the v of the stage the rate belongs to. */
static void shifted(const System *s, const State *x, const State *stage, const Rate *rate, double h, State *out) {
    for (int i = 0; i < s->modes; ++i) {
        out->q[i] = x->q[i] + h * stage->v[i];
    }
    for (int i = 0; i < s->modes; ++i) {
        out->v[i] = x->v[i] + h * rate->v[i];
    }
    for (int a = 0; a < s->axes; ++a) {
        out->z[a] = x->z[a] + h * rate->z[a];
        out->c[a] = x->c[a] + h * rate->c[a];
        out->motor_n[a] = x->motor_n[a] + h * rate->motor_n[a];
        out->delta[a] = x->delta[a] + h * rate->delta[a];
    }
    for (int m = 0; m < s->mounts; ++m) {
        out->F_f[m] = x->F_f[m] + h * rate->F_f[m];
        out->F_v[m] = x->F_v[m] + h * rate->F_v[m];
        out->F_s[m] = x->F_s[m];
        out->side[m] = x->side[m];
    }
}

void advance(const System *s, State *x, double T, int steps, const double *M_begin, const double *M_end) {
    const double h = T / steps;
    State s2, s3, s4;
    Rate k1, k2, k3, k4;
    double M[3][MAX_AXES];
    for (int j = 0; j < steps; ++j) {
        for (int m = 0; m < s->mounts; ++m) { /* a reversal lies within a step: 1e-6 N of friction */
            const double speed = dot(s->mount[m].port, x->v, s->modes), side = speed < 0 ? -1 : 1;
            if (side != x->side[m]) {
                x->side[m] = side;
                x->F_s[m] = x->F_f[m];
            }
        }
        for (int a = 0; a < s->axes; ++a) {
            for (int half = 0; half < 3; ++half) {
                M[half][a] = M_begin[a] + (M_end[a] - M_begin[a]) * (2 * j + half) / (2.0 * steps);
            }
        }
        rate_of(s, x, M[0], &k1);
        shifted(s, x, x, &k1, h / 2, &s2);
        rate_of(s, &s2, M[1], &k2);
        shifted(s, x, &s2, &k2, h / 2, &s3);
        rate_of(s, &s3, M[1], &k3);
        shifted(s, x, &s3, &k3, h, &s4);
        rate_of(s, &s4, M[2], &k4);
        for (int i = 0; i < s->modes; ++i) {
            double v = x->v[i];
            x->q[i] += h / 6 * (v + 2 * s2.v[i] + 2 * s3.v[i] + s4.v[i]);
            x->v[i] = v + h / 6 * (k1.v[i] + 2 * k2.v[i] + 2 * k3.v[i] + k4.v[i]);
        }
        for (int a = 0; a < s->axes; ++a) {
            x->motor_n[a] += h / 6 * (k1.motor_n[a] + 2 * k2.motor_n[a] + 2 * k3.motor_n[a] + k4.motor_n[a]);
            x->delta[a] += h / 6 * (k1.delta[a] + 2 * k2.delta[a] + 2 * k3.delta[a] + k4.delta[a]);
            x->z[a] += h / 6 * (k1.z[a] + 2 * k2.z[a] + 2 * k3.z[a] + k4.z[a]);
            x->c[a] = clip(x->c[a] + h / 6 * (k1.c[a] + 2 * k2.c[a] + 2 * k3.c[a] + k4.c[a]), s->friction[a].W / 2);
        }
        for (int m = 0; m < s->mounts; ++m) {
            x->F_f[m] += h / 6 * (k1.F_f[m] + 2 * k2.F_f[m] + 2 * k3.F_f[m] + k4.F_f[m]);
            x->F_v[m] += h / 6 * (k1.F_v[m] + 2 * k2.F_v[m] + 2 * k3.F_v[m] + k4.F_v[m]);
            x->E[m] += h / 6 * (k1.E[m] + 2 * k2.E[m] + 2 * k3.E[m] + k4.E[m]);
        }
    }
}
