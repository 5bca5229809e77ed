#include "geometry.h"

double geometry_play(double y, double x, double b) {
    const double low = x - b / 2, high = x + b / 2;
    return y < low ? low : y > high ? high : y;
}

double geometry_hysteresis(double e, double dx, double w) {
    const double moved = e + dx;
    return moved < -w ? -w : moved > w ? w : moved;
}

void geometry_arms(Geometry *p, int j, const double *first, const double *second, const double *r) {
    for (int i = 0; i < 3; i++) {
        const int next = (i + 1) % 3, last = (i + 2) % 3; /* a row of the cross product */
        p->linear[i][j] += first[next] * r[last] - first[last] * r[next];
        p->second[i][j] += second[next] * r[last] - second[last] * r[next];
    }
}

void geometry_errors(const Geometry *p, const double *s, double *error) {
    for (int i = 0; i < 3; i++) {
        error[i] = 0;
        for (int j = 0; j < 3; j++) {
            error[i] += s[j] * (p->linear[i][j] + s[j] * (p->second[i][j] + s[j] * p->third[i][j]));
        }
    }
}

void geometry_slopes(const Geometry *p, const double *s, const double *v, double *slope) {
    for (int i = 0; i < 3; i++) {
        slope[i] = 0;
        for (int j = 0; j < 3; j++) {
            slope[i] += v[j] * (p->linear[i][j] + s[j] * (2 * p->second[i][j] + 3 * s[j] * p->third[i][j]));
        }
    }
}
