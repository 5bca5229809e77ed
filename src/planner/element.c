#include "element.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "spline.h"

#define HALF_PI 1.57079632679489661923
#define LEAST_LENGTH 1e-10 /* what is shorter does not move [m] */

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
bool make_room(void **memory, size_t *room, size_t wanted, size_t size) {
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

/* --- rows */

const double *row_start(const Program *p, int64_t row) {
    return row == 0 ? p->start : p->end + (row - 1) * p->axes;
}

bool axis_is_geometric(const Program *p, int64_t axis) {
    return axis == p->space_x || axis == p->space_y || axis == p->space_z;
}

void row_lengths(const Program *p, const double *from, const double *to, double *all, double *fed) {
    double sum = 0, geometric = 0;
    for (int64_t i = 0; i < p->axes; i++) {
        const double d = to[i] - from[i];
        sum += d * d;
        geometric += axis_is_geometric(p, i) ? d * d : 0;
    }
    *all = sqrt(sum);
    *fed = sqrt(geometric > 0 ? geometric : sum);
}

static bool moves(const Program *p, int64_t row) {
    if (p->motion[row] == ARC) {
        return true;
    }
    double all, fed;
    row_lengths(p, row_start(p, row), p->end + row * p->axes, &all, &fed);
    return p->motion[row] != DWELL && all > LEAST_LENGTH;
}

int64_t next_row(const Program *p, int64_t row) {
    while (row < p->rows && p->motion[row] != DWELL && !moves(p, row)) {
        row++;
    }
    return row;
}

bool row_moves_tool(const Program *p, int64_t row) {
    const double *from = row_start(p, row), *to = p->end + row * p->axes;
    for (int64_t i = 0; i < p->axes; i++) {
        if (axis_is_geometric(p, i) && to[i] != from[i]) {
            return true;
        }
    }
    return p->motion[row] == ARC;
}

double row_feed(const Program *p, int64_t row) {
    return p->feed[row] > 0 ? p->feed[row] : HUGE_VAL; /* NaN: a rapid */
}

bool rows_stop_between(const Program *p, int64_t row, int64_t next) {
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

/* --- lines, arcs and splines */

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
    const double *from = row_start(p, row), *to = p->end + row * p->axes;
    row_lengths(p, from, to, &z->curve.c, programmed);
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
    const double *from = row_start(p, row), *to = p->end + row * p->axes;
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

bool row_is_short(const Program *p, int64_t row) {
    if (!p->compressed[row] || p->motion[row] != LINE) {
        return false;
    }
    double all, fed;
    row_lengths(p, row_start(p, row), p->end + row * p->axes, &all, &fed);
    return all <= p->short_block;
}

static double tolerance_of_spline(const Program *p, int64_t row) {
    return p->blending[row] == TOLERANCE && p->tolerance[row] > 0 ? p->tolerance[row] : p->spline_tolerance;
}

/* Angle between two lines, as the length of the difference of their directions. */
static double turn_between(const Program *p, const Side *side, const Side *next) {
    const double *a = row_start(p, side->row), *b = p->end + side->row * p->axes;
    const double *c = row_start(p, next->row), *d = p->end + next->row * p->axes;
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
        row_lengths(p, row_start(p, row), p->end + row * p->axes, &side->length, &side->programmed);
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
        if (rows_stop_between(p, row, next) || !row_is_short(p, next)) {
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
        memcpy(corner, row_start(p, e->row), axes * sizeof *corner);
        for (size_t k = 0; k < sides; k++) {
            const double *from = row_start(p, side[k].row), *to = p->end + side[k].row * p->axes;
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

bool element_read(Builder *builder, int64_t row, double *s, Element *e) {
    const Program *p = builder->program;
    double programmed = 0;
    e->count = 0;
    e->length = 0;
    e->row = e->last = row;
    e->s = *s;
    e->trim = 0;
    if (p->motion[row] == ARC  ? !arc_element(p, row, e, &programmed)
        : row_is_short(p, row) ? !spline_element(builder, e, &programmed)
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

double element_at(const Element *e, size_t axes, double q, int order, double x[][PLANNER_AXES]) {
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

bool element_is_straight(const Element *e) {
    return e->count == 1 && e->piece->curve.degree == 1 && e->piece->curve.w == 0;
}
