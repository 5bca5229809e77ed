#include "points.h"

Points points_of(double first, double spacing, const double *at) {
    Points p = {.used = spacing > 0.0, .first = first, .spacing = spacing};
    for (int i = 0; i < POINTS; ++i) {
        p.at[i] = at[i];
    }
    return p;
}

double points_value(const Points *p, double x) {
    const double place = (x - p->first) / p->spacing;
    if (!(place > 0.0)) {
        return p->at[0];
    }
    if (place >= POINTS - 1) {
        return p->at[POINTS - 1];
    }
    const int below = (int)place;
    const double share = place - below;
    return p->at[below] + share * (p->at[below + 1] - p->at[below]);
}
