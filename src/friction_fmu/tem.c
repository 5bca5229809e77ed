#include "tem.h"

double tem_advance(double c, double angle, double W) {
    const double moved = c + angle;
    if (moved > W / 2) {
        return W / 2;
    }
    return moved < -W / 2 ? -W / 2 : moved;
}

double tem_engagement(double z, double c, double W) {
    if (W <= 0) {
        return 1;
    }
    return (W / 2 + (z >= 0 ? c : -c)) / W;
}

double tem_share(double lambda, double gamma) {
    return gamma + lambda * (1 - gamma);
}
