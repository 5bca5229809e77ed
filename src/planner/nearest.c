#include "nearest.h"

#include <math.h>
#include <string.h>

static const double TURN = 6.283185307179586;
/* Points that are as near as this [m] are equally near. */
static const double EQUALLY_NEAR = 1e-9;
/* Steps to the nearest point of a helix: the first one is that of a circle, and each doubles the digits. */
enum { HELIX_STEPS = 6 };

typedef struct {
    double distance, s, u;
    int64_t element;
} Candidate;

static double dot(const double *a, const double *b, int64_t n) {
    double sum = 0.0;
    for (int64_t i = 0; i < n; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

/* Point of an element at its share u, and where `direction` is asked for that of the path there, of length 1. */
static void point_at(const ProgrammedPath *path, int64_t k, double u, double *x, double *direction) {
    int64_t n = path->axes, row = k * n;
    double angle = path->angle[k], c = cos(u * angle), s = sin(u * angle);
    for (int64_t i = 0; i < n; i++) {
        x[i] = path->begin[row + i] + u * path->line[row + i] + path->cosine[row + i] * (c - 1.0) +
               path->sine[row + i] * s;
    }
    if (direction == NULL) {
        return;
    }
    for (int64_t i = 0; i < n; i++) {
        direction[i] = path->line[row + i] + angle * (path->sine[row + i] * c - path->cosine[row + i] * s);
    }
    double length = sqrt(dot(direction, direction, n));
    for (int64_t i = 0; i < n && length > 0.0; i++) {
        direction[i] /= length;
    }
}

static double clipped(double value, double low, double high) {
    return value < low ? low : value > high ? high : value;
}

/* Share u of a line, low to high, that is nearest to x. */
static double nearest_of_line(const ProgrammedPath *path, int64_t k, const double *x, double low, double high) {
    int64_t n = path->axes, row = k * n;
    double along = 0.0, square = dot(path->line + row, path->line + row, n);
    for (int64_t i = 0; i < n; i++) {
        along += (x[i] - path->begin[row + i]) * path->line[row + i];
    }
    return square > 0.0 ? clipped(along / square, low, high) : low;
}

/* Share u of an arc nearest to x in the turn that is nearest to the share `at`. */
static double nearest_of_arc(const ProgrammedPath *path, int64_t k, const double *x, double low, double high,
                             double at) {
    int64_t n = path->axes, row = k * n;
    const double *begin = path->begin + row, *line = path->line + row;
    const double *cosine = path->cosine + row, *sine = path->sine + row;
    double angle = path->angle[k], c = 0.0, s = 0.0;
    for (int64_t i = 0; i < n; i++) {
        double from_centre = x[i] - begin[i] + cosine[i];
        c += from_centre * cosine[i];
        s += from_centre * sine[i];
    }
    double phi = c == 0.0 && s == 0.0 ? at * angle : atan2(s, c);
    phi += TURN * floor((at * angle - phi) / TURN + 0.5);
    if (phi > high * angle && phi - TURN >= low * angle) {
        phi -= TURN;
    } else if (phi < low * angle && phi + TURN <= high * angle) {
        phi += TURN;
    }
    if (phi < low * angle || phi > high * angle) { /* beyond: the nearer end */
        double to_low = c * cos(low * angle) + s * sin(low * angle);
        phi = to_low > c * cos(high * angle) + s * sin(high * angle) ? low * angle : high * angle;
    }
    double u = clipped(phi / angle, low, high);
    if (dot(line, line, n) > 0.0) { /* Gauss and Newton: d/du of half the squared distance is 0 */
        for (int step = 0; step < HELIX_STEPS; step++) {
            double first = 0.0, second = 0.0, cu = cos(u * angle), su = sin(u * angle);
            for (int64_t i = 0; i < n; i++) {
                double off = begin[i] + u * line[i] + cosine[i] * (cu - 1.0) + sine[i] * su - x[i];
                double slope = line[i] + angle * (sine[i] * cu - cosine[i] * su);
                first += off * slope;
                second += slope * slope - off * angle * angle * (cosine[i] * cu + sine[i] * su);
            }
            if (!(second > 0.0)) {
                break;
            }
            u = clipped(u - first / second, low, high);
        }
    }
    return u;
}

/* Whether candidate b takes the place of a. */
static int better(const Candidate *a, const Candidate *b, double at) {
    if (a->element < 0 || b->distance < a->distance - EQUALLY_NEAR) {
        return 1;
    }
    return b->distance <= a->distance + EQUALLY_NEAR && fabs(b->s - at) < fabs(a->s - at);
}

void planner_nearest(const ProgrammedPath *path, int64_t count, const double *x, const double *at, const double *reach,
                     int64_t *element, double *s, double *point, double *direction) {
    int64_t n = path->axes, last = path->elements - 1, from = 0;
    double there[PLANNER_AXES];
    for (int64_t row = 0; row < count; row++) {
        double total = path->s[path->elements], here = clipped(at[row], path->s[0], total);
        double low = here - reach[row], high = here + reach[row];
        const double *position = x + row * n;
        while (from > 0 && path->s[from] > low) {
            from--;
        }
        while (from < last && path->s[from + 1] < low) {
            from++;
        }
        /* A minimum at the end of an element is one of the path where the next element begins with one, too: else
         * elements in a row would each offer their end. */
        Candidate best = {0.0, 0.0, 0.0, -1}, end = {0.0, 0.0, 0.0, -1};
        for (int64_t k = from; k <= last && path->s[k] <= high; k++) {
            double length = path->s[k + 1] - path->s[k];
            double first = length > 0.0 ? clipped((low - path->s[k]) / length, 0.0, 1.0) : 0.0;
            double final = length > 0.0 ? clipped((high - path->s[k]) / length, 0.0, 1.0) : 1.0;
            double near = length > 0.0 ? (here - path->s[k]) / length : 0.0;
            double u = path->angle[k] == 0.0 ? nearest_of_line(path, k, position, first, final)
                                             : nearest_of_arc(path, k, position, first, final, clipped(near, 0.0, 1.0));
            point_at(path, k, u, there, NULL);
            double square = 0.0;
            for (int64_t i = 0; i < n; i++) {
                square += (position[i] - there[i]) * (position[i] - there[i]);
            }
            Candidate now = {sqrt(square), path->s[k] + u * length, u, k};
            int begins = u <= first && first == 0.0 && k > from;
            if (end.element >= 0 && begins && better(&best, &end, here)) {
                best = end;
            }
            end.element = -1;
            if (u >= 1.0 && k < last && path->s[k + 1] < high) {
                end = now;
            } else if (!begins && better(&best, &now, here)) {
                best = now;
            }
        }
        if (end.element >= 0 && better(&best, &end, here)) {
            best = end;
        }
        if (best.element < 0) { /* an arc that is nearest at its begin and its end */
            best = (Candidate){0.0, here, 0.0, from};
            while (best.element < last && path->s[best.element + 1] < here) {
                best.element++;
            }
            double length = path->s[best.element + 1] - path->s[best.element];
            best.u = length > 0.0 ? clipped((here - path->s[best.element]) / length, 0.0, 1.0) : 0.0;
        }
        element[row] = best.element;
        s[row] = best.s;
        point_at(path, best.element, best.u, point + row * n, direction + row * n);
    }
}
