#include "geometry.h"

double geometry_play(double y, double x, double b) {
    const double low = x - b / 2, high = x + b / 2;
    return y < low ? low : y > high ? high : y;
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
