#include "control.h"

#include <math.h>

static const double PI_ = 3.14159265358979323846;

/* Bilinear transform s = g (z - 1)/(z + 1) of (n2 s^2 + n1 s + n0)/(d2 s^2 + d1 s + d0), steady at `value`. */
static Section bilinear(const double n[3], const double d[3], double g) {
    Section f;
    double a0 = d[2] * g * g + d[1] * g + d[0];
    f.b[0] = (n[2] * g * g + n[1] * g + n[0]) / a0;
    f.b[1] = 2 * (n[0] - n[2] * g * g) / a0;
    f.b[2] = (n[2] * g * g - n[1] * g + n[0]) / a0;
    f.a[0] = 2 * (d[0] - d[2] * g * g) / a0;
    f.a[1] = (d[2] * g * g - d[1] * g + d[0]) / a0;
    f.s[0] = f.s[1] = 0;
    return f;
}

static double filtered(Section *f, double u) {
    double y = f->b[0] * u + f->s[0];
    f->s[0] = f->b[1] * u - f->a[0] * y + f->s[1];
    f->s[1] = f->b[2] * u - f->a[1] * y;
    return y;
}

static double clip(double value, double limit) {
    return value > limit ? limit : value < -limit ? -limit : value;
}

/* Value of a setpoint series at `delay` before its sample m, by the cubic through four samples: one newer and two older
 * than the interval, or samples 0..3 back where there is no newer one. */
static double delayed(const double *series, int count, double before, long m, double T_pos, double delay) {
    double d = delay / T_pos;
    long first = (long)floor(d) - 1;
    double sum = 0;
    if (first < 0) {
        first = 0;
    }
    for (long i = first; i < first + 4; ++i) {
        double weight = 1;
        for (long j = first; j < first + 4; ++j) {
            if (j != i) {
                weight *= (d - (double)j) / (double)(i - j);
            }
        }
        long index = m - i;
        sum += weight * (index < 0 ? before : series[index < count ? index : count - 1]);
    }
    return sum;
}

void control_start(Control *c) {
    const Drive *p = &c->drive;
    double w = p->omega_0, wf = 2 * PI_ * p->f;
    c->reference = bilinear((const double[3]){w * w, 0, 0}, (const double[3]){w * w, 2 * p->D * w, 1}, 2 / p->T_c);
    if (p->f > 0) {
        c->band_stop = bilinear((const double[3]){wf * wf, 2 * p->D_num * wf, 1},
                                (const double[3]){wf * wf, 2 * p->D_den * wf, 1}, wf / tan(wf * p->T_c / 2));
    }
    c->lag = c->lag_input = p->x_start;
    c->n_old = c->n_new = c->speed_integral = 0;
    for (int j = 0; j < 2; ++j) {
        c->current_integral[j] = c->u[j] = c->i[j] = 0;
    }
}

static void position_loop(Control *c, long m, double x_a) {
    const Drive *p = &c->drive;
    double n_ffw = delayed(c->n_ffw, c->setpoints, 0, m, p->T_pos, p->T_dyn);
    double x_s;
    if (p->symmetry_lag != 0) {
        /* first-order hold: the input runs linearly between two samples, the lag is solved exactly */
        double input = delayed(c->x_s, c->setpoints, p->x_start, m, p->T_pos, p->T_dyn);
        double r = p->T_pos / p->T_sym, slope = (input - c->lag_input) / r;
        c->lag = input - slope + (c->lag - c->lag_input + slope) * exp(-r);
        c->lag_input = input;
        x_s = c->lag;
    } else {
        x_s = delayed(c->x_s, c->setpoints, p->x_start, m, p->T_pos, p->T_dyn + p->T_sym);
    }
    c->x_e = x_s - x_a;
    c->n_old = c->n_new;
    c->n_new = p->K_v * c->x_e / p->I_P + p->k_ffw * n_ffw;
}

/* dq equations with u and n_a held, exactly over T_c: i' = A i + b by the closed form of the 2x2 exponential. */
static void motor(Control *c, double n_a) {
    const Drive *p = &c->drive;
    double w = p->p * n_a, psi = p->K_t / (1.5 * p->p), T = p->T_c;
    double A[2][2] = {{-p->R / p->L_d, w * p->L_q / p->L_d}, {-w * p->L_d / p->L_q, -p->R / p->L_q}};
    double b[2] = {c->u[0] / p->L_d, (c->u[1] - w * psi) / p->L_q};
    double det = A[0][0] * A[1][1] - A[0][1] * A[1][0];
    double steady[2] = {(-b[0] * A[1][1] + b[1] * A[0][1]) / det, (-b[1] * A[0][0] + b[0] * A[1][0]) / det};
    double mean = (A[0][0] + A[1][1]) / 2, s2 = mean * mean - det; /* eigenvalues mean +- sqrt(s2) */
    double root = sqrt(fabs(s2)), C = s2 < 0 ? cos(root * T) : cosh(root * T);
    double S = root * T < 1e-9 ? T : (s2 < 0 ? sin(root * T) : sinh(root * T)) / root;
    double e0 = c->i[0] - steady[0], e1 = c->i[1] - steady[1], decay = exp(mean * T);
    c->i[0] = steady[0] + decay * ((C + S * (A[0][0] - mean)) * e0 + S * A[0][1] * e1);
    c->i[1] = steady[1] + decay * (S * A[1][0] * e0 + (C + S * (A[1][1] - mean)) * e1);
}

static void current_loop(Control *c, double M_filtered, double n_a, double *u) {
    const Drive *p = &c->drive;
    double w = p->p * n_a, psi = p->K_t / (1.5 * p->p), gain = p->K_p_current * p->T_c / p->T_n_current;
    double e[2] = {-c->i[0], M_filtered / p->K_t - c->i[1]};
    double ahead[2] = {-w * p->L_q * c->i[1], w * p->L_d * c->i[0] + p->emf_feedforward * w * psi};
    for (int j = 0; j < 2; ++j) {
        c->current_integral[j] += gain * e[j];
        u[j] = p->K_p_current * e[j] + c->current_integral[j] + ahead[j];
    }
    double amplitude = hypot(u[0], u[1]);
    if (amplitude > p->u_max) {
        for (int j = 0; j < 2; ++j) {
            double limited = u[j] * p->u_max / amplitude;
            c->current_integral[j] += (limited - u[j]) * p->T_c / p->T_n_current;
            u[j] = limited;
        }
    }
}

double control_sample(Control *c, long k, double x_a, double n_a) {
    const Drive *p = &c->drive;
    long ratio = lround(p->T_pos / p->T_c), tick = k % ratio;
    c->i_sample[0] = c->i[0], c->i_sample[1] = c->i[1];
    if (tick == 0) {
        position_loop(c, k / ratio, x_a);
    }
    c->n_s = p->ramp != 0 ? c->n_old + (c->n_new - c->n_old) * (double)(tick + 1) / (double)ratio : c->n_new;
    c->n_ref = p->reference_model != 0 ? filtered(&c->reference, c->n_s) : c->n_s;

    double P = p->K_p * (c->n_s - n_a);
    if (p->integrator != 0) {
        c->speed_integral += p->K_p * p->T_c / p->T_n * (c->n_ref - n_a);
    }
    double wanted = P + c->speed_integral;
    c->M_s = clip(wanted, p->M_max);
    if (p->integrator != 0) {
        c->speed_integral += (c->M_s - wanted) * p->T_c / p->T_n;
    }
    double M_filtered = p->f > 0 ? filtered(&c->band_stop, c->M_s) : c->M_s;
    if (p->ideal_current_loop != 0) {
        return M_filtered;
    }

    double u_next[2];
    current_loop(c, M_filtered, n_a, u_next);
    motor(c, n_a); /* with the voltage stored one sample ago */
    c->u[0] = u_next[0], c->u[1] = u_next[1];
    return 1.5 * p->p * (p->K_t / (1.5 * p->p) + (p->L_d - p->L_q) * c->i[0]) * c->i[1];
}
