#include "path.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "corner.h"
#include "element.h"

#define HALF_PI 1.57079632679489661923
#define SMOOTH 1e-10          /* difference of two unit tangents that is none.. */
#define SMOOTH_CURVATURE 1e-6 /* ..and of two curvatures [1/m] */

void zones_free(Zones *zones) {
    free(zones->zone);
    free(zones->derivatives);
    memset(zones, 0, sizeof *zones);
}

void builder_free(Builder *builder) {
    free(builder->element.piece);
    free(builder->next.piece);
    free(builder->scratch);
    free(builder->side);
    memset(builder, 0, sizeof *builder);
}
/* --- limits */

static void lower(Zone *z, Bound bound, double V, int64_t axis) {
    if (V < z->V[bound]) {
        z->V[bound] = V;
        z->V_axis[bound] = (int8_t)axis;
    }
}

/* On an interval of width h between two points a function is at most the larger value at its ends, plus h^2/8 times the
 * largest second derivative. So largest derivatives of orders 1 to 3 follow from those of orders 3 to 5. */
static bool set_limits(const Program *p, Zones *zones, Zone *z, double feed, bool geometric) {
    const size_t axes = (size_t)p->axes;
    const double c = z->curve.c, g1 = 1 / c, g2 = g1 * g1, g3 = g2 * g1;
    for (int b = 0; b < BOUND_COUNT; b++) {
        z->V[b] = HUGE_VAL;
        z->V_axis[b] = -1;
    }
    z->a_path = z->j_path = z->a_line = z->j_line = HUGE_VAL;
    z->a_axis = z->j_axis = -1;
    const bool arc = z->curve.w != 0;
    double norm = 0, fed = 0;
    if (!arc && z->curve.degree == 1) {
        for (size_t i = 0; i < axes; i++) {
            const double x = fabs(z->curve.p[1][i]) * g1;
            norm += x * x;
            fed += !geometric || axis_is_geometric(p, (int64_t)i) ? x * x : 0;
            if (x > 0) {
                lower(z, BOUND_SPEED, p->max_speed[i] / x, (int64_t)i);
                if (p->max_acceleration[i] / x < z->a_line) {
                    z->a_line = p->max_acceleration[i] / x;
                    z->a_axis = (int8_t)i;
                }
                if (p->max_jerk[i] / x < z->j_line) {
                    z->j_line = p->max_jerk[i] / x;
                    z->j_axis = (int8_t)i;
                }
            }
        }
        norm = sqrt(norm);
        fed = sqrt(fed);
    } else {
        const double span = z->u1 - z->u0;
        const double wanted = arc ? 16 * z->curve.w * span / HALF_PI : (z->curve.degree > 3 ? 16 : 4);
        z->intervals = (size_t)fmax(2, ceil(wanted));
        z->derivatives = zones->used;
        if (!make_room((void **)&zones->derivatives, &zones->derivatives_room, zones->used + 3 * axes * z->intervals,
                       sizeof(double))) {
            return false;
        }
        zones->used += 3 * axes * z->intervals;
        double point[2][6][PLANNER_AXES];
        curve_at(&z->curve, axes, z->u0, 4, point[0]);
        const double h = span / (double)z->intervals, factor = h * h / 8;
        for (size_t k = 0; k < z->intervals; k++) {
            double (*x)[PLANNER_AXES] = point[k & 1], (*y)[PLANNER_AXES] = point[!(k & 1)];
            double *X = zones->derivatives + z->derivatives + 3 * axes * k;
            curve_at(&z->curve, axes, z->u0 + h * (double)(k + 1), 4, y);
            double square[2] = {0, 0}, square_fed[2] = {0, 0}, bend = 0, first = 0, third = 0;
            for (size_t i = 0; i < axes; i++) {
                double X1 = fmax(fabs(x[1][i]), fabs(y[1][i])), X2 = fmax(fabs(x[2][i]), fabs(y[2][i]));
                double X3 = fmax(fabs(x[3][i]), fabs(y[3][i]));
                if (arc) {
                    const double w = z->curve.w;
                    const double r3 = w * w * w * sqrt(z->curve.a[i] * z->curve.a[i] + z->curve.b[i] * z->curve.b[i]);
                    X3 = fmin(X3 + factor * r3 * w * w, r3);
                    X2 = fmin(X2 + factor * r3 * w, r3 / w);
                    X1 += factor * r3;
                } else {
                    X3 += z->curve.degree == 5 ? factor * 120 * fabs(z->curve.p[5][i]) : 0;
                    X2 += factor * fmax(fabs(x[4][i]), fabs(y[4][i]));
                    X1 += factor * X3;
                }
                X[3 * i] = X1 * g1;
                X[3 * i + 1] = X2 * g2;
                X[3 * i + 2] = X3 * g3;
                const bool is_fed = !geometric || axis_is_geometric(p, (int64_t)i);
                square[0] += x[1][i] * x[1][i];
                square[1] += y[1][i] * y[1][i];
                square_fed[0] += is_fed ? x[1][i] * x[1][i] : 0;
                square_fed[1] += is_fed ? y[1][i] * y[1][i] : 0;
                first += X1 * X1;
                third += X3 * X3;
                lower(z, BOUND_SPEED, p->max_speed[i] / X[3 * i], (int64_t)i);
                lower(z, BOUND_ACCELERATION, sqrt(p->max_acceleration[i] / X[3 * i + 1]), (int64_t)i);
                lower(z, BOUND_JERK, cbrt(p->max_jerk[i] / X[3 * i + 2]), (int64_t)i);
            }
            /* |x'|^2 has the second derivative 2 (|x''|^2 + x' . x'''); where that is positive, the largest value is at
             * an end. Of an arc it is constant but for rounding. */
            bend = arc ? 0 : factor * 2 * sqrt(first * third);
            norm = fmax(norm, fmax(square[0], square[1]) + bend);
            fed = fmax(fed, fmax(square_fed[0], square_fed[1]) + bend);
        }
        norm = sqrt(norm) * g1;
        fed = sqrt(fed) * g1;
    }
    lower(z, BOUND_FEED, feed / fed, -1);
    z->a_path = p->path_acceleration / norm;
    z->j_path = p->path_jerk / norm;
    return true;
}

/* --- the builder */

static bool is_element(const Element *e, int64_t row, double s) {
    return e->count > 0 && e->row == row && e->s == s;
}

/* A long spline is fitted once, not for each of the sections that are sampled in it. */
static bool read_once(Builder *builder, int64_t row, double *s, Element *e) {
    if (!is_element(e, row, *s)) {
        if (!element_read(builder, row, s, e)) {
            e->count = 0;
            return false;
        }
        e->behind = *s;
    }
    e->trim = 0;
    *s = e->behind;
    return true;
}

bool builder_begin(Builder *builder, int64_t row, double s) {
    if (is_element(&builder->next, row, s)) {
        const Element behind = builder->element;
        builder->element = builder->next;
        builder->next = behind;
    }
    builder->s = s;
    if (!read_once(builder, row, &builder->s, &builder->element)) {
        return false;
    }
    builder->row = next_row(builder->program, builder->element.last + 1);
    return true;
}

static Zone *append(Zones *zones, const Element *e, size_t index) {
    if (!make_room((void **)&zones->zone, &zones->room, zones->count + 1, sizeof *zones->zone)) {
        return NULL;
    }
    Zone *z = &zones->zone[zones->count++];
    memset(z, 0, sizeof *z);
    z->element = e->row;
    z->element_s = e->s;
    z->index = (int64_t)index;
    return z;
}

/* What of the element lies between the corners. */
static bool append_element(const Program *p, Zones *zones, const Element *e, double trim_end) {
    double q = 0;
    for (size_t k = 0; k < e->count; k++) {
        const Zone *piece = &e->piece[k];
        if (zones->enough > 0 && zones->count >= zones->enough) {
            break;
        }
        if (zones->enough > 0 && e->row == zones->skipped && (int64_t)k < zones->skipped_pieces) {
            q += piece->length;
            continue;
        }
        const double from = fmax(q, e->trim), to = fmin(q + piece->length, e->length - trim_end);
        if (to - from > 1e-13 * e->length) {
            Zone *z = append(zones, e, k);
            if (z == NULL) {
                return false;
            }
            const Zone named = *z;
            *z = *piece;
            z->element = named.element;
            z->element_s = named.element_s;
            z->index = named.index;
            z->restarts = from == q && k > 0;
            const double per = (piece->u1 - piece->u0) / piece->length, place = (piece->s1 - piece->s0) / piece->length;
            z->u0 = from > q ? piece->u0 + (from - q) * per : piece->u0;
            z->u1 = to < q + piece->length ? piece->u0 + (to - q) * per : piece->u1;
            z->s0 = piece->s0 + (from - q) * place;
            z->s1 = piece->s0 + (to - q) * place;
            z->length = to - from;
            if (!set_limits(p, zones, z, row_feed(p, z->row), row_moves_tool(p, z->row))) {
                return false;
            }
        }
        q += piece->length;
    }
    return true;
}

/* The first element and the corner behind it, its leg; nothing, and leg 0, where there is no corner. False without
 * memory. */
static bool append_corner(const Program *p, Zones *zones, const Element *e1, const Element *e2, double *leg,
                          bool *stops, bool *appended) {
    const size_t axes = (size_t)p->axes;
    double x1[3][PLANNER_AXES], x2[3][PLANNER_AXES];
    const double s = element_at(e1, axes, e1->length, 2, x1);
    element_at(e2, axes, 0, 2, x2);
    double norm[2] = {0, 0}, cosine = 0, jump = 0, bend = 0;
    for (size_t i = 0; i < axes; i++) {
        norm[0] += x1[1][i] * x1[1][i];
        norm[1] += x2[1][i] * x2[1][i];
    }
    for (size_t i = 0; i < axes; i++) {
        const double t1 = x1[1][i] / sqrt(norm[0]), t2 = x2[1][i] / sqrt(norm[1]);
        cosine += t1 * t2;
        jump += (t2 - t1) * (t2 - t1);
        bend += (x2[2][i] - x1[2][i]) * (x2[2][i] - x1[2][i]);
    }
    jump = sqrt(jump);
    *leg = 0;
    *stops = false;
    if (jump < SMOOTH && sqrt(bend) < SMOOTH_CURVATURE) {
        return true;
    }
    const double longest = 0.5 * fmin(e1->length, e2->length);
    int blending = p->blending[e1->last];
    double L = 0;
    if (blending == DISTANCE) {
        L = fmin(p->tolerance[e1->last], longest);
        blending = L > LEAST_LEG ? DISTANCE : CONTINUOUS;
    } else if (blending == TOLERANCE) {
        L = corner_leg(e1, e2, axes, longest, p->tolerance[e1->last], jump, cosine);
        if (!(L > LEAST_LEG)) {
            *stops = true;
            return true;
        }
    }
    const bool soft = p->jerk_limited[e1->last];
    *appended = true;
    if (!append_element(p, zones, e1, L)) {
        return false;
    }
    Zone *z = append(zones, e1, e1->count);
    if (z == NULL) {
        return false;
    }
    *leg = L;
    z->restarts = true;
    z->row = e1->last;
    z->row_end = e2->row;
    z->s0 = z->s1 = z->s_vertex = s;
    z->u1 = 1;
    z->kind = blending == CONTINUOUS ? ZONE_VERTEX : ZONE_CORNER;
    const double feed = fmin(row_feed(p, e1->last), row_feed(p, e2->row));
    if (blending == CONTINUOUS) {
        z->curve = (Curve){.degree = 0, .c = 0};
        for (size_t i = 0; i < axes; i++) {
            z->curve.p[0][i] = x2[0][i];
        }
        for (int b = 0; b < BOUND_COUNT; b++) {
            z->V[b] = HUGE_VAL;
            z->V_axis[b] = -1;
        }
        z->V[BOUND_FEED] = feed;
        z->a_path = z->j_path = z->a_line = z->j_line = HUGE_VAL;
        z->a_axis = z->j_axis = -1;
        for (size_t i = 0; i < axes; i++) {
            lower(z, BOUND_STEP, p->speed_jump[i] / fabs(x2[1][i] - x1[1][i]), (int64_t)i);
            if (soft) {
                lower(z, BOUND_STEP, sqrt(p->max_jerk[i] * p->step_time / fabs(x2[2][i] - x1[2][i])), (int64_t)i);
            }
        }
        return true;
    }
    if (blending == DISTANCE && element_is_straight(e1) && element_is_straight(e2)) {
        z->curve = (Curve){.degree = 2, .c = 2 * L};
        for (size_t i = 0; i < axes; i++) {
            z->curve.p[0][i] = x1[0][i] - L * x1[1][i];
            z->curve.p[1][i] = 2 * L * x1[1][i];
            z->curve.p[2][i] = L * (x2[1][i] - x1[1][i]);
        }
        z->s0 = s - L;
        z->s1 = s + L;
    } else {
        double place[2];
        corner_curve(e1, e2, axes, L, cosine, &z->curve, place);
        z->s0 = place[0];
        z->s1 = place[1];
    }
    z->length = z->curve.c;
    if (!set_limits(p, zones, z, feed, row_moves_tool(p, e1->last) || row_moves_tool(p, e2->row))) {
        return false;
    }
    if (z->curve.degree == 2 && soft) {
        for (size_t i = 0; i < axes; i++) {
            const double step = fabs(x2[1][i] - x1[1][i]) / (2 * L);
            lower(z, BOUND_STEP, sqrt(p->max_jerk[i] * p->step_time / step), (int64_t)i);
        }
    }
    return true;
}

bool builder_next(Builder *builder, Zones *zones, bool *stops) {
    const Program *p = builder->program;
    bool appended = false;
    double leg = 0;
    *stops = rows_stop_between(p, builder->element.last, builder->row);
    if (!*stops) {
        double s = builder->s;
        if (!read_once(builder, builder->row, &s, &builder->next) ||
            !append_corner(p, zones, &builder->element, &builder->next, &leg, stops, &appended)) {
            return false;
        }
        if (!*stops) {
            builder->s = s;
        }
    }
    if (!appended && !append_element(p, zones, &builder->element, 0)) {
        return false;
    }
    if (!*stops) {
        const Element behind = builder->element;
        builder->element = builder->next;
        builder->next = behind;
        builder->element.trim = leg;
        builder->row = next_row(p, builder->element.last + 1);
    }
    return true;
}

bool builder_alone(Builder *builder, Zones *zones) {
    Element *e = &builder->element;
    const double trim = e->trim;
    e->trim = 0;
    const bool held = append_element(builder->program, zones, e, 0);
    e->trim = trim;
    return held;
}

int64_t row_in_corner(const Program *p, const Zone *z, double s, double *end) {
    double all, programmed;
    int64_t row = s < z->s_vertex ? z->row : z->row_end;
    *end = s < z->s_vertex ? z->s_vertex : HUGE_VAL;
    if (!row_is_short(p, row)) {
        return row;
    }
    row_lengths(p, row_start(p, row), p->end + row * p->axes, &all, &programmed);
    if (s < z->s_vertex) {
        while (s < *end - programmed && row > 0 && row_is_short(p, row - 1)) {
            *end -= programmed;
            row--;
            row_lengths(p, row_start(p, row), p->end + row * p->axes, &all, &programmed);
        }
    } else {
        *end = z->s_vertex + programmed;
        while (s >= *end && row + 1 < p->rows && row_is_short(p, row + 1)) {
            row++;
            row_lengths(p, row_start(p, row), p->end + row * p->axes, &all, &programmed);
            *end += programmed;
        }
    }
    return row;
}
