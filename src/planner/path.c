#include "path.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "spline.h"

#define HALF_PI 1.57079632679489661923
#define LEAST_LENGTH 1e-10    /* what is shorter does not move [m] */
#define LEAST_LEG 1e-9        /* [m] */
#define SMOOTH 1e-10          /* difference of two unit tangents that is none.. */
#define SMOOTH_CURVATURE 1e-6 /* ..and of two curvatures [1/m] */

enum { RAPID, LINE, ARC, DWELL };
enum { EXACT_STOP, CONTINUOUS, DISTANCE, TOLERANCE };

void curve_at(const Curve *curve, size_t axes, double u, int order, double x[][PLANNER_AXES]) {
    for (int k = 0; k <= order; k++) {
        for (size_t i = 0; i < axes; i++) {
            double sum = 0;
            for (int n = curve->degree; n >= k; n--) {
                double factor = 1;
                for (int m = n; m > n - k; m--) {
                    factor *= m;
                }
                sum = sum * u + factor * curve->p[n][i];
            }
            x[k][i] = sum;
        }
    }
    if (curve->w != 0) {
        const double cosine = cos(curve->w * u), sine = sin(curve->w * u);
        double power = 1;
        for (int k = 0; k <= order; k++) {
            /* derivatives of cos: cos, -sin, -cos, sin, .. */
            const double of_a = (k & 1) ? ((k & 2) ? sine : -sine) : ((k & 2) ? -cosine : cosine);
            const double of_b = (k & 1) ? ((k & 2) ? -cosine : cosine) : ((k & 2) ? -sine : sine);
            for (size_t i = 0; i < axes; i++) {
                x[k][i] += power * (of_a * curve->a[i] + of_b * curve->b[i]);
            }
            power *= curve->w;
        }
    }
}

/* --- memory */

static bool make_room(void **memory, size_t *room, size_t wanted, size_t size) {
    if (wanted <= *room) {
        return true;
    }
    size_t fresh = *room ? *room : 16;
    while (fresh < wanted) {
        fresh *= 2;
    }
    void *moved = realloc(*memory, fresh * size);
    if (moved == NULL) {
        return false;
    }
    *memory = moved;
    *room = fresh;
    return true;
}

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

/* --- rows */

static const double *start_of(const Program *p, int64_t row) {
    return row == 0 ? p->start : p->end + (row - 1) * p->axes;
}

static bool is_geometric(const Program *p, int64_t axis) {
    return axis == p->space_x || axis == p->space_y || axis == p->space_z;
}

/* Lengths of a straight displacement: over all axes, and over those that the programmed speed is for. */
static void measure(const Program *p, const double *from, const double *to, double *all, double *fed) {
    double sum = 0, geometric = 0;
    for (int64_t i = 0; i < p->axes; i++) {
        const double d = to[i] - from[i];
        sum += d * d;
        geometric += is_geometric(p, i) ? d * d : 0;
    }
    *all = sqrt(sum);
    *fed = sqrt(geometric > 0 ? geometric : sum);
}

static bool moves(const Program *p, int64_t row) {
    if (p->motion[row] == ARC) {
        return true;
    }
    double all, fed;
    measure(p, start_of(p, row), p->end + row * p->axes, &all, &fed);
    return p->motion[row] != DWELL && all > LEAST_LENGTH;
}

int64_t next_row(const Program *p, int64_t row) {
    while (row < p->rows && p->motion[row] != DWELL && !moves(p, row)) {
        row++;
    }
    return row;
}

/* Whether the row moves X, Y or Z, to which the programmed speed then belongs. */
static bool moves_tool(const Program *p, int64_t row) {
    const double *from = start_of(p, row), *to = p->end + row * p->axes;
    for (int64_t i = 0; i < p->axes; i++) {
        if (is_geometric(p, i) && to[i] != from[i]) {
            return true;
        }
    }
    return p->motion[row] == ARC;
}

static double feed_of(const Program *p, int64_t row) {
    return p->feed[row] > 0 ? p->feed[row] : HUGE_VAL; /* NaN: a rapid */
}

/* Whether the motion stops between `row` and `next`, the row that moves or dwells after it. */
static bool stops_between(const Program *p, int64_t row, int64_t next) {
    if (next >= p->rows || p->motion[next] == DWELL || !p->jerk_limited[next] != !p->jerk_limited[row]) {
        return true;
    }
    for (int64_t i = row; i < next; i++) {
        if (p->blending[i] == EXACT_STOP || (p->blending[i] == TOLERANCE && !(p->tolerance[i] > LEAST_LEG))) {
            return true;
        }
    }
    return false;
}

/* --- elements */

static Zone *new_piece(Element *e) {
    if (!make_room((void **)&e->piece, &e->room, e->count + 1, sizeof *e->piece)) {
        return NULL;
    }
    Zone *piece = &e->piece[e->count++];
    memset(piece, 0, sizeof *piece);
    piece->u1 = 1;
    return piece;
}

static bool line_element(const Program *p, int64_t row, Element *e, double *programmed) {
    Zone *z = new_piece(e);
    if (z == NULL) {
        return false;
    }
    const double *from = start_of(p, row), *to = p->end + row * p->axes;
    measure(p, from, to, &z->curve.c, programmed);
    z->curve.degree = 1;
    for (int64_t i = 0; i < p->axes; i++) {
        z->curve.p[0][i] = from[i];
        z->curve.p[1][i] = to[i] - from[i];
    }
    return true;
}

/* x = centre + a cos + b sin + a straight share: along the normal, of other axes, and what the programmed end, rounded
 * as it is, lies beside the circle. */
static bool arc_element(const Program *p, int64_t row, Element *e, double *programmed) {
    const double *from = start_of(p, row), *to = p->end + row * p->axes;
    const double *centre = p->centre + 3 * row, *normal = p->normal + 3 * row;
    const int64_t space[3] = {p->space_x, p->space_y, p->space_z};
    const double angle = p->angle[row];
    double radius[3], across[3];
    for (size_t k = 0; k < 3; k++) {
        radius[k] = space[k] < 0 ? 0 : from[space[k]] - centre[k];
    }
    double r = 0, rise = 0;
    for (size_t k = 0; k < 3; k++) {
        const size_t l = (k + 1) % 3, m = (k + 2) % 3;
        across[k] = normal[l] * radius[m] - normal[m] * radius[l];
        r += radius[k] * radius[k];
    }
    r = sqrt(r);
    Curve curve = {.degree = 1, .w = angle};
    for (int64_t i = 0; i < p->axes; i++) {
        curve.p[0][i] = from[i];
        curve.p[1][i] = to[i] - from[i];
    }
    for (size_t k = 0; k < 3; k++) {
        if (space[k] >= 0) {
            const size_t i = (size_t)space[k];
            curve.a[i] = radius[k];
            curve.b[i] = across[k];
            curve.p[0][i] -= radius[k];
            curve.p[1][i] -= radius[k] * (cos(angle) - 1) + across[k] * sin(angle);
        }
    }
    double straight = 0;
    for (int64_t i = 0; i < p->axes; i++) {
        straight += curve.p[1][i] * curve.p[1][i];
    }
    for (size_t k = 0; k < 3; k++) {
        rise += space[k] < 0 ? 0 : normal[k] * curve.p[1][space[k]];
    }
    curve.c = sqrt(r * r * angle * angle + straight);
    *programmed = sqrt(r * r * angle * angle + rise * rise);
    const double pieces = ceil(angle / HALF_PI - 1e-9);
    for (double k = 0; k < pieces; k++) {
        Zone *z = new_piece(e);
        if (z == NULL) {
            return false;
        }
        z->curve = curve;
        z->u0 = k / pieces;
        z->u1 = (k + 1) / pieces;
    }
    return true;
}

#define MOST_SIDES 4096
#define UNEVEN 3      /* a side is divided where it is longer than this times one beside it.. */
#define MOST_PARTS 64 /* ..into at most as many parts */
#define FIT 0.95      /* share of the tolerance for the spline at the points that are looked at */

/* Whether a row may be part of a spline. */
static bool is_short(const Program *p, int64_t row) {
    if (!p->compressed[row] || p->motion[row] != LINE) {
        return false;
    }
    double all, fed;
    measure(p, start_of(p, row), p->end + row * p->axes, &all, &fed);
    return all <= p->short_block;
}

static double tolerance_of_spline(const Program *p, int64_t row) {
    return p->blending[row] == TOLERANCE && p->tolerance[row] > 0 ? p->tolerance[row] : p->spline_tolerance;
}

/* Angle between two lines, as the length of the difference of their directions. */
static double turn_between(const Program *p, const Side *side, const Side *next) {
    const double *a = start_of(p, side->row), *b = p->end + side->row * p->axes;
    const double *c = start_of(p, next->row), *d = p->end + next->row * p->axes;
    double sum = 0;
    for (int64_t i = 0; i < p->axes; i++) {
        const double difference = (d[i] - c[i]) / next->length - (b[i] - a[i]) / side->length;
        sum += difference * difference;
    }
    return sqrt(sum);
}

/* Rows from `row` on that one spline may follow: short lines without a stop or a sharp corner between them. Sharp is
 * also what sides of that length and angle cannot do within the tolerance. Returns their number, 0 without memory. */
static size_t find_sides(Builder *builder, int64_t row, double *tolerance) {
    const Program *p = builder->program;
    size_t count = 0;
    *tolerance = HUGE_VAL;
    while (count < MOST_SIDES) {
        if (!make_room((void **)&builder->side, &builder->side_room, count + 1, sizeof *builder->side)) {
            return 0;
        }
        Side *side = &builder->side[count];
        *side = (Side){.row = row, .parts = 1};
        measure(p, start_of(p, row), p->end + row * p->axes, &side->length, &side->programmed);
        const double own = fmin(*tolerance, tolerance_of_spline(p, row));
        if (count > 0) {
            side->turn = turn_between(p, side - 1, side);
            if (side->turn > p->split_angle || side->turn * fmin(side->length, side[-1].length) > 8 * own) {
                break;
            }
        }
        *tolerance = own;
        count++;
        const int64_t next = next_row(p, row + 1);
        if (stops_between(p, row, next) || !is_short(p, next)) {
            break;
        }
        row = next;
    }
    return count;
}

/* A spline within the tolerance of the rows from the element's on; fewer of them where it needs a corner. */
static bool spline_element(Builder *builder, Element *e, double *programmed) {
    const Program *p = builder->program;
    const size_t axes = (size_t)p->axes;
    double tolerance;
    size_t sides = find_sides(builder, e->row, &tolerance), points = 1;
    Side *side = builder->side;
    Spline spline;
    for (;; points = 1) {
        for (size_t k = 0; k < sides; k++) {
            double beside = HUGE_VAL, turn = 0;
            if (k > 0) {
                beside = side[k - 1].length;
                turn = side[k].turn;
            }
            if (k + 1 < sides) {
                beside = fmin(beside, side[k + 1].length);
                turn = fmax(turn, side[k + 1].turn);
            }
            const bool divided = side[k].length > UNEVEN * beside && turn * side[k].length > 2 * tolerance;
            side[k].parts = divided ? (size_t)fmin(MOST_PARTS, ceil(side[k].length / (UNEVEN * beside))) : 1;
            points += side[k].parts;
        }
        if (sides < 2) {
            return sides == 1 && line_element(p, e->row, e, programmed);
        }
        if (!make_room((void **)&builder->scratch, &builder->scratch_room, spline_memory(points, axes),
                       sizeof(double))) {
            return false;
        }
        spline_lay_out(&spline, points, axes, builder->scratch);
        double *corner = spline.corner;
        memcpy(corner, start_of(p, e->row), axes * sizeof *corner);
        for (size_t k = 0; k < sides; k++) {
            const double *from = start_of(p, side[k].row), *to = p->end + side[k].row * p->axes;
            for (size_t part = 1; part <= side[k].parts; part++) {
                corner += axes;
                for (size_t i = 0; i < axes; i++) {
                    corner[i] = part == side[k].parts
                                    ? to[i]
                                    : from[i] + (to[i] - from[i]) * (double)part / (double)side[k].parts;
                }
            }
        }
        size_t worst = 0;
        if (fit_spline(&spline, FIT * tolerance, &worst) <= FIT * tolerance) {
            break;
        }
        /* A corner where it strays first, at the sharper end of that side. */
        size_t at = 0;
        while (worst >= side[at].parts) {
            worst -= side[at++].parts;
        }
        const size_t behind = at + 1 < sides && (at == 0 || side[at + 1].turn > side[at].turn) ? at + 1 : at;
        sides = behind > 0 && behind < sides ? behind : sides - 1;
    }
    size_t k = 0;
    for (size_t each = 0; each < sides; each++) {
        const double per = side[each].programmed / (double)side[each].parts;
        for (size_t part = 0; part < side[each].parts; part++, k++) {
            Zone *z = new_piece(e);
            if (z == NULL) {
                return false;
            }
            const double h = spline.h[k], square = h * h;
            z->curve = (Curve){.degree = 3, .c = h};
            for (size_t i = 0; i < axes; i++) {
                const double *g = spline.value + k * axes + i, *second = spline.second + k * axes + i;
                z->curve.p[0][i] = g[0];
                z->curve.p[1][i] = g[axes] - g[0] - square / 6 * (2 * second[0] + second[axes]);
                z->curve.p[2][i] = square / 2 * second[0];
                z->curve.p[3][i] = square / 6 * (second[axes] - second[0]);
            }
            z->row = z->row_end = side[each].row;
            z->s0 = *programmed;
            z->s1 = *programmed += per;
            z->strays = spline.distance[k];
        }
    }
    e->last = side[sides - 1].row;
    return true;
}

/* Read the row, and as many as belong to its spline; *s: place of the begin, then of the end on the programmed path. */
static bool read_element(Builder *builder, int64_t row, double *s, Element *e) {
    const Program *p = builder->program;
    double programmed = 0;
    e->count = 0;
    e->length = 0;
    e->row = e->last = row;
    e->s = *s;
    e->trim = 0;
    if (p->motion[row] == ARC ? !arc_element(p, row, e, &programmed)
        : is_short(p, row)    ? !spline_element(builder, e, &programmed)
                              : !line_element(p, row, e, &programmed)) {
        return false;
    }
    for (size_t k = 0; k < e->count; k++) {
        Zone *z = &e->piece[k];
        if (e->last == row && e->piece->curve.degree == 1) {
            z->row = z->row_end = row;
            z->s0 = programmed * z->u0;
            z->s1 = programmed * z->u1;
        }
        z->s0 += *s;
        z->s1 += *s;
        z->length = z->curve.c * (z->u1 - z->u0);
        e->length += z->length;
    }
    *s += programmed;
    return true;
}

/* Position and derivatives by q at q from the element's begin, and the place on the programmed path. */
static double element_at(const Element *e, size_t axes, double q, int order, double x[][PLANNER_AXES]) {
    size_t k = 0;
    if (q < 0.5 * e->length) {
        while (k + 1 < e->count && q > e->piece[k].length) {
            q -= e->piece[k++].length;
        }
    } else {
        double behind = e->length - q;
        for (k = e->count - 1; k > 0 && behind > e->piece[k].length; k--) {
            behind -= e->piece[k].length;
        }
        q = e->piece[k].length - behind;
    }
    const Zone *z = &e->piece[k];
    curve_at(&z->curve, axes, z->u0 + q / z->curve.c, order, x);
    double factor = 1;
    for (int n = 1; n <= order; n++) {
        factor /= z->curve.c;
        for (size_t i = 0; i < axes; i++) {
            x[n][i] *= factor;
        }
    }
    return z->s0 + (z->s1 - z->s0) * (z->length > 0 ? q / z->length : 0);
}

static bool is_straight(const Element *e) {
    return e->count == 1 && e->piece->curve.degree == 1 && e->piece->curve.w == 0;
}

/* --- corners */

static double distance(size_t axes, const double *a, const double *b) {
    double sum = 0;
    for (size_t i = 0; i < axes; i++) {
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    }
    return sqrt(sum);
}

/* First derivative by u at both ends. 2 L makes a straight line run evenly and is the fastest up to 120 degrees or so;
 * where the path turns back, less is. */
static double first_derivative(double L, double cosine) {
    return L * (2 + 0.7 * fmin(cosine, 0));
}

/* The quintic that goes on from the elements with position and two derivatives by q. */
static void quintic(const Element *e1, const Element *e2, size_t axes, double L, double cosine, Curve *curve,
                    double s[2]) {
    double x0[3][PLANNER_AXES], x1[3][PLANNER_AXES];
    s[0] = element_at(e1, axes, e1->length - L, 2, x0);
    s[1] = element_at(e2, axes, L, 2, x1);
    const double c = first_derivative(L, cosine);
    *curve = (Curve){.degree = 5, .c = c};
    for (size_t i = 0; i < axes; i++) {
        const double D = x1[0][i] - x0[0][i], d0 = c * x0[1][i], d1 = c * x1[1][i];
        const double a0 = c * c * x0[2][i], a1 = c * c * x1[2][i];
        curve->p[0][i] = x0[0][i];
        curve->p[1][i] = d0;
        curve->p[2][i] = a0 / 2;
        curve->p[3][i] = 10 * D - 6 * d0 - 4 * d1 - 1.5 * a0 + 0.5 * a1;
        curve->p[4][i] = -15 * D + 8 * d0 + 7 * d1 + 1.5 * a0 - a1;
        curve->p[5][i] = 6 * D - 3 * d0 - 3 * d1 - 0.5 * a0 + 0.5 * a1;
    }
}

/* Distance of a point from the stretch q0..q1 of an element, by Newton's method from q. */
static double distance_from(const Element *e, size_t axes, const double *point, double q0, double q1, double q) {
    double x[3][PLANNER_AXES];
    for (int step = 0; step < 8; step++) {
        element_at(e, axes, q, 2, x);
        double slope = 0, curvature = 0;
        for (size_t i = 0; i < axes; i++) {
            const double d = x[0][i] - point[i];
            slope += d * x[1][i];
            curvature += x[1][i] * x[1][i] + d * x[2][i];
        }
        const double wanted = curvature > 0 ? q - slope / curvature : (slope > 0 ? q0 : q1);
        const double next = wanted < q0 ? q0 : (wanted > q1 ? q1 : wanted);
        if (fabs(next - q) < 1e-12) {
            break;
        }
        q = next;
    }
    element_at(e, axes, q, 0, x);
    return distance(axes, point, x[0]);
}

#define DEVIATION_POINTS 16

/* Largest distance between the corner and the elements that it replaces. */
static double deviation(const Element *e1, const Element *e2, size_t axes, double L, double cosine) {
    Curve curve;
    double s[2], x[1][PLANNER_AXES], vertex[1][PLANNER_AXES];
    quintic(e1, e2, axes, L, cosine, &curve, s);
    element_at(e2, axes, 0, 0, vertex);
    curve_at(&curve, axes, 0.5, 0, x);
    double largest = distance(axes, x[0], vertex[0]);
    for (int k = 1; k < DEVIATION_POINTS; k++) {
        const double u = (double)k / DEVIATION_POINTS;
        curve_at(&curve, axes, u, 0, x);
        const double along = (2 * u - 1) * L;
        const double first = distance_from(e1, axes, x[0], e1->length - L, e1->length, e1->length + fmin(along, 0));
        const double second = distance_from(e2, axes, x[0], 0, L, fmax(along, 0));
        largest = fmax(largest, fmin(first, second));
    }
    return largest;
}

/* Largest distance of the stretch q0..q1 of an element from the programmed path. */
static double strays(const Element *e, double q0, double q1) {
    double largest = 0, q = 0;
    for (size_t k = 0; k < e->count; q += e->piece[k++].length) {
        if (q < q1 && q + e->piece[k].length > q0) {
            largest = fmax(largest, e->piece[k].strays);
        }
    }
    return largest;
}

/* The longest leg with which the corner stays within `tolerance`. */
static double leg_within(const Element *e1, const Element *e2, size_t axes, double longest, double tolerance,
                         double jump, double cosine) {
    if (is_straight(e1) && is_straight(e2)) {
        const double c = first_derivative(1, cosine);
        return fmin(longest, tolerance / (jump * (0.5 - 5 * c / 32)));
    }
    if (e1->count > 1 || e2->count > 1) {
        /* Splines stray from the programmed path already. */
        const double half = tolerance / 2;
        if (strays(e1, e1->length - longest, e1->length) > 0 || strays(e2, 0, longest) > 0) {
            tolerance = half;
            while (fmax(strays(e1, e1->length - longest, e1->length), strays(e2, 0, longest)) > half) {
                longest /= 2;
            }
        }
    }
    /* The deviation grows with the leg, with its square where the directions agree: then along the chord through the
     * last two, which a curve that bends upwards crosses on the safe side. */
    const double wanted = 0.98 * tolerance;
    double L = longest, d = deviation(e1, e2, axes, L, cosine);
    double shorter = L * (jump > 0.01 ? wanted / d : sqrt(wanted / d));
    for (int step = 0; step < 20 && d > tolerance; step++) {
        const double reached = deviation(e1, e2, axes, shorter, cosine), slope = (d - reached) / (L - shorter);
        L = shorter;
        d = reached;
        shorter = fmin(fmax(slope > 0 ? L - (d - wanted) / slope : 0, L / 4), 0.98 * L);
    }
    return d > tolerance ? 0 : L;
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
            fed += !geometric || is_geometric(p, (int64_t)i) ? x * x : 0;
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
                const bool is_fed = !geometric || is_geometric(p, (int64_t)i);
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
        if (!read_element(builder, row, s, e)) {
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
            if (!set_limits(p, zones, z, feed_of(p, z->row), moves_tool(p, z->row))) {
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
        L = leg_within(e1, e2, axes, longest, p->tolerance[e1->last], jump, cosine);
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
    const double feed = fmin(feed_of(p, e1->last), feed_of(p, e2->row));
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
    if (blending == DISTANCE && is_straight(e1) && is_straight(e2)) {
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
        quintic(e1, e2, axes, L, cosine, &z->curve, place);
        z->s0 = place[0];
        z->s1 = place[1];
    }
    z->length = z->curve.c;
    if (!set_limits(p, zones, z, feed, moves_tool(p, e1->last) || moves_tool(p, e2->row))) {
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
    *stops = stops_between(p, builder->element.last, builder->row);
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
    if (!is_short(p, row)) {
        return row;
    }
    measure(p, start_of(p, row), p->end + row * p->axes, &all, &programmed);
    if (s < z->s_vertex) {
        while (s < *end - programmed && row > 0 && is_short(p, row - 1)) {
            *end -= programmed;
            row--;
            measure(p, start_of(p, row), p->end + row * p->axes, &all, &programmed);
        }
    } else {
        *end = z->s_vertex + programmed;
        while (s >= *end && row + 1 < p->rows && is_short(p, row + 1)) {
            row++;
            measure(p, start_of(p, row), p->end + row * p->axes, &all, &programmed);
            *end += programmed;
        }
    }
    return row;
}
