#include "speed.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- limits of a zone */

double zone_speed(const Stretch *stretch, const Zone *z, Bound *bound) {
    double V = HUGE_VAL;
    for (int b = 0; b < BOUND_COUNT; b++) {
        double own = z->V[b];
        if (b == BOUND_ACCELERATION) {
            own *= sqrt(stretch->share);
        } else if (b == BOUND_JERK) {
            own = stretch->T > 0 ? own * cbrt(stretch->share) : HUGE_VAL;
        }
        if (own < V) {
            V = own;
            *bound = (Bound)b;
        }
    }
    return V;
}

double zone_acceleration(const Stretch *stretch, const Zone *z, double V, int *kind, int *axis) {
    const Program *p = stretch->program;
    const size_t axes = (size_t)p->axes;
    const double T = stretch->T;
    double A = z->a_path;
    *kind = 3;
    *axis = -1;
    if (T > 0 && z->j_path * T < A) {
        A = z->j_path * T;
        *kind = 4;
    }
    if (z->intervals == 0) {
        if (z->a_line < A) {
            A = z->a_line;
            *kind = 3;
            *axis = z->a_axis;
        }
        if (T > 0 && z->j_line * T < A) {
            A = z->j_line * T;
            *kind = 4;
            *axis = z->j_axis;
        }
        return A;
    }
    const double V2 = V * V, V3 = V2 * V, rate = T > 0 ? 1 / T : 0;
    const double *X = stretch->derivatives + z->derivatives;
    for (size_t k = 0; k < z->intervals; k++) {
        for (size_t i = 0; i < axes; i++, X += 3) {
            const double rest = p->max_acceleration[i] - X[1] * V2;
            if (rest < A * X[0]) {
                A = rest / X[0];
                *kind = 3;
                *axis = (int)i;
            }
            if (T > 0) {
                const double rest_jerk = p->max_jerk[i] - X[2] * V3, per = X[0] * rate + 3 * X[1] * V;
                if (rest_jerk < A * per) {
                    A = rest_jerk / per;
                    *kind = 4;
                    *axis = (int)i;
                }
            }
        }
    }
    return A;
}

/* --- memory */

void speed_free(Speed *speed) {
    free(speed->V);
    free(speed->A);
    free(speed->starts);
    free(speed->ends);
    free(speed->spare);
    free(speed->heap_V);
    free(speed->heap_A);
    free(speed->cell);
    free(speed->node);
    free(speed->phase);
    memset(speed, 0, sizeof *speed);
}

/* For n zones: 2 n cells, three nodes in each. */
static bool make_room_for(Speed *speed, size_t n) {
    if (n <= speed->room) {
        return true;
    }
    speed_free(speed);
    const size_t room = n + n / 2 + 8;
    speed->V = malloc(room * sizeof *speed->V);
    speed->A = malloc(room * sizeof *speed->A);
    speed->starts = malloc(room * sizeof *speed->starts);
    speed->ends = malloc(room * sizeof *speed->ends);
    speed->spare = malloc(room * sizeof *speed->spare);
    speed->heap_V = malloc(room * sizeof *speed->heap_V);
    speed->heap_A = malloc(room * sizeof *speed->heap_A);
    speed->cell = malloc((2 * room + 1) * sizeof *speed->cell);
    speed->node = malloc((6 * room + 4) * 2 * sizeof *speed->node);
    speed->phase = malloc((6 * room + 4) * sizeof *speed->phase);
    if (!speed->V || !speed->A || !speed->starts || !speed->ends || !speed->spare || !speed->heap_V || !speed->heap_A ||
        !speed->cell || !speed->node || !speed->phase) {
        speed_free(speed);
        return false;
    }
    speed->room = room;
    return true;
}

/* --- the least limits of the zones around */

/* Merge sort that begins with what is in order already. */
static void sort_ends(End *ends, End *spare, size_t n) {
    bool sorted = true;
    for (size_t i = 1; i < n && sorted; i++) {
        sorted = ends[i - 1].q <= ends[i].q;
    }
    if (sorted) {
        return;
    }
    if (n <= 12) {
        for (size_t i = 1; i < n; i++) {
            const End moved = ends[i];
            size_t j = i;
            for (; j > 0 && ends[j - 1].q > moved.q; j--) {
                ends[j] = ends[j - 1];
            }
            ends[j] = moved;
        }
        return;
    }
    const size_t half = n / 2;
    sort_ends(ends, spare, half);
    sort_ends(ends + half, spare, n - half);
    memcpy(spare, ends, half * sizeof *ends);
    size_t i = 0, j = half, to = 0;
    while (i < half && j < n) {
        ends[to++] = ends[j].q < spare[i].q ? ends[j++] : spare[i++];
    }
    memcpy(ends + to, spare + i, (half - i) * sizeof *ends);
}

/* Heaps of zones, the least key on top. */
static void push(int32_t *heap, size_t *count, const double *key, int32_t zone) {
    size_t i = (*count)++;
    while (i > 0 && key[heap[(i - 1) / 2]] > key[zone]) {
        heap[i] = heap[(i - 1) / 2];
        i = (i - 1) / 2;
    }
    heap[i] = zone;
}

static void pop(int32_t *heap, size_t *count, const double *key) {
    const int32_t last = heap[--*count];
    size_t i = 0;
    for (size_t child = 1; child < *count; child = 2 * i + 1) {
        child += child + 1 < *count && key[heap[child + 1]] < key[heap[child]];
        if (key[heap[child]] >= key[last]) {
            break;
        }
        heap[i] = heap[child];
        i = child;
    }
    heap[i] = last;
}

/* Cut the stretch at the ends of all widened zones; in each cell the least V and A of the zones that reach it. */
static void make_cells(const Stretch *stretch, Speed *speed) {
    const size_t n = stretch->count;
    for (size_t k = 0; k < n; k++) {
        const Zone *z = &stretch->zone[k];
        const double half = speed->V[k] * stretch->T / 2;
        speed->starts[k] = (End){fmax(z->q - half, stretch->q0), (int32_t)k};
        speed->ends[k] = (End){fmin(z->q + z->length + half, stretch->q1), (int32_t)k};
    }
    /* Where a zone's end is now, by its number: the sorted list loses it. */
    sort_ends(speed->starts, speed->spare, n);
    sort_ends(speed->ends, speed->spare, n);
    size_t count_V = 0, count_A = 0, i = 0, j = 0, cells = 0;
    double q = stretch->q0;
    while (q < stretch->q1) {
        double point = HUGE_VAL; /* the least V^2 of zones without length */
        for (; i < n && speed->starts[i].q <= q; i++) {
            const int32_t k = speed->starts[i].zone;
            push(speed->heap_V, &count_V, speed->V, k);
            push(speed->heap_A, &count_A, speed->A, k);
        }
        for (; j < n && speed->ends[j].q <= q; j++) {
            point = fmin(point, speed->V[speed->ends[j].zone]);
        }
        const double half_T = stretch->T / 2;
        for (const Zone *z; count_V > 0; pop(speed->heap_V, &count_V, speed->V)) {
            z = &stretch->zone[speed->heap_V[0]];
            if (z->q + z->length + speed->V[speed->heap_V[0]] * half_T > q) {
                break;
            }
        }
        for (const Zone *z; count_A > 0; pop(speed->heap_A, &count_A, speed->A)) {
            z = &stretch->zone[speed->heap_A[0]];
            if (z->q + z->length + speed->V[speed->heap_A[0]] * half_T > q) {
                break;
            }
        }
        double next = stretch->q1;
        if (i < n) {
            next = fmin(next, speed->starts[i].q);
        }
        if (j < n) {
            next = fmin(next, speed->ends[j].q);
        }
        if (count_V > 0 && count_A > 0) {
            const double V = speed->V[speed->heap_V[0]];
            speed->cell[cells++] =
                (Cell){q, V * V, speed->A[speed->heap_A[0]], point * point, speed->heap_V[0], speed->heap_A[0]};
        }
        q = next;
    }
    speed->cell[cells] = (Cell){.q = stretch->q1};
    speed->cells = cells;
}

/* --- steps of acceleration */

/* v^2 at the cells' borders, one pass backwards and one forwards. False: the speeds at the ends are not reached. */
static bool limit_borders(const Stretch *stretch, Speed *speed) {
    Cell *c = speed->cell;
    const size_t n = speed->cells;
    const double w0 = stretch->v0 * stretch->v0, w1 = stretch->v1 * stretch->v1;
    const double most = 1 + 1e-12;
    if (n == 0 || w0 > c[0].V2 * most || w1 > c[n - 1].V2 * most) {
        return false;
    }
    c[n].w = w1;
    for (size_t k = n; k-- > 0;) {
        const double reach = c[k + 1].w + 2 * c[k].A * (c[k + 1].q - c[k].q);
        const double cap = fmin(c[k].V2, k > 0 ? fmin(c[k - 1].V2, c[k].w) : HUGE_VAL);
        c[k].w = fmin(cap, reach);
    }
    if (c[0].w * most < w0) {
        return false;
    }
    c[0].w = w0;
    for (size_t k = 0; k < n; k++) {
        c[k + 1].w = fmin(c[k + 1].w, c[k].w + 2 * c[k].A * (c[k + 1].q - c[k].q));
    }
    return c[n].w * most >= w1;
}

/* In each cell: accelerate, cruise, brake. */
static size_t make_nodes(const Speed *speed, Node *node) {
    size_t count = 0;
    for (size_t k = 0; k < speed->cells; k++) {
        const Cell *c = &speed->cell[k];
        const double d = c[1].q - c->q, A = c->A, w0 = c->w, w1 = c[1].w;
        const double top = fmax(fmin(c->V2, (w0 + w1) / 2 + A * d), fmax(w0, w1));
        const double rise = (top - w0) / (2 * A), fall = (top - w1) / (2 * A);
        if (top > w0) {
            node[count++] = (Node){c->q, w0, A};
        }
        if (rise + fall < d * (1 - 1e-14)) {
            node[count++] = (Node){c->q + rise, top, 0};
        }
        if (top > w1) {
            node[count++] = (Node){c[1].q - fall, top, -A};
        }
    }
    node[count] = (Node){speed->cell[speed->cells].q, speed->cell[speed->cells].w, 0};
    return count + 1;
}

/* Tops between acceleration and braking that last less than T are lowered until they last T, or to the higher one of
 * the valleys beside. `in` has a last node at the stretch's end; `out` takes as many. Returns the number of nodes. */
static size_t lower_tops(const Stretch *stretch, Node *in, size_t n, Node *out) {
    const double T = stretch->T;
    size_t count = 0;
    for (size_t i = 0; i + 1 < n;) {
        if (in[i].a >= 0 || T <= 0) {
            out[count++] = in[i++];
            continue;
        }
        /* It brakes from here on. Does it accelerate into the plateau ahead? */
        size_t left = count;
        while (left > 0 && out[left - 1].a == 0) {
            left--;
        }
        double level = in[i].w;
        double s0 = left < count ? out[left].s : in[i].s, s1 = in[i].s;
        if (left == 0 || out[left - 1].a < 0 || s1 - s0 >= sqrt(level) * T * (1 - 1e-13)) {
            out[count++] = in[i++];
            continue;
        }
        count = left;
        for (;;) {
            /* out[count - 1] rises from its w to the level at s0; in[i] falls from the level at s1. */
            const Node *rising = &out[count - 1];
            Node *falling = &in[i];
            const double w0 = rising->w, w1 = in[i + 1].w, next = fmax(w0, w1);
            const double at0 = w0 >= w1 ? rising->s : s0 - (level - next) / (2 * rising->a);
            const double at1 = w1 >= w0 ? in[i + 1].s : s1 + (level - next) / (-2 * falling->a);
            if (at1 - at0 >= sqrt(next) * T) {
                const double per = 1 / (2 * rising->a) - 1 / (2 * falling->a);
                const double C = at1 - at0 + per * next;
                const double v = 2 * C / (T + sqrt(T * T + 4 * per * C));
                const double lowered = fmin(fmax(v * v, next), level);
                s0 = at0 + (lowered - next) / (2 * rising->a);
                s1 = at1 - (lowered - next) / (-2 * falling->a);
                level = lowered;
                falling->s = s1;
                falling->w = level;
                break;
            }
            level = next;
            s0 = at0;
            s1 = at1;
            if (w1 >= w0) {
                i++;
                while (i + 1 < n && in[i].a == 0) {
                    s1 = in[++i].s;
                }
            } else {
                falling->s = s1;
                falling->w = level;
            }
            if (w0 >= w1) {
                count--;
                while (count > 0 && out[count - 1].a == 0) {
                    s0 = out[--count].s;
                }
            }
            if (count == 0 || out[count - 1].a < 0 || i + 1 >= n || in[i].a > 0 ||
                s1 - s0 >= sqrt(level) * T * (1 - 1e-13)) {
                break; /* a valley, or shelves have made it long enough */
            }
        }
        if (s1 > s0) {
            out[count++] = (Node){s0, level, 0};
        }
        if (i + 1 < n) {
            out[count++] = in[i++];
        }
    }
    out[count++] = in[n - 1];
    return count;
}

/* Whether the speed at both ends stays for T/2. */
static bool keeps_ends(const Stretch *stretch, const Node *node, size_t n) {
    const double half = stretch->T / 2 * (1 - 1e-9);
    if (stretch->v0 > 0) {
        size_t k = 0;
        while (k + 1 < n && node[k].a == 0) {
            k++;
        }
        if (node[k].s - stretch->q0 < stretch->v0 * half) {
            return false;
        }
    }
    if (stretch->v1 > 0) {
        size_t k = n - 1;
        while (k > 0 && node[k - 1].a == 0) {
            k--;
        }
        if (stretch->q1 - node[k].s < stretch->v1 * half) {
            return false;
        }
    }
    return true;
}

static void two_sum(double *sum, double *rest, double term) {
    const double total = *sum + term, part = total - *sum;
    *rest += (*sum - (total - part)) + (term - part);
    *sum = total;
}

static void make_phases(Speed *speed, const Node *node, size_t n) {
    double t = 0, S = 0, S_rest = 0;
    size_t count = 0;
    for (size_t k = 0; k + 1 < n; k++) {
        const double v = sqrt(node[k].w), v_end = sqrt(node[k + 1].w), a = node[k].a;
        const double s = node[k].s - speed->q0;
        const double d = a == 0 ? (node[k + 1].s - node[k].s) / v : (node[k + 1].w - node[k].w) / ((v + v_end) * a);
        if (!(d > 0)) {
            continue;
        }
        speed->phase[count++] = (Phase){t, s, v, a, S, S_rest};
        two_sum(&S, &S_rest, d * (s + d * (v / 2 + d * a / 6)));
        t += d;
    }
    const double end = speed->q1 - speed->q0;
    speed->phase[count] = (Phase){t, end, speed->v1, 0, S, S_rest};
    speed->phases = count;
    speed->unfiltered = t;
}

int plan_speed(const Stretch *stretch, Speed *speed) {
    if (!make_room_for(speed, stretch->count)) {
        return -1;
    }
    speed->T = stretch->T;
    speed->v0 = stretch->v0;
    speed->v1 = stretch->v1;
    speed->q0 = stretch->q0;
    speed->q1 = stretch->q1;
    for (size_t k = 0; k < stretch->count; k++) {
        Bound bound;
        int kind, axis;
        double V = zone_speed(stretch, &stretch->zone[k], &bound);
        if (k == 0 && stretch->v0 > 0) {
            V = stretch->v0;
        } else if (k + 1 == stretch->count && stretch->v1 > 0) {
            V = stretch->v1;
        }
        speed->V[k] = V;
        speed->A[k] = zone_acceleration(stretch, &stretch->zone[k], V, &kind, &axis);
    }
    make_cells(stretch, speed);
    if (!limit_borders(stretch, speed)) {
        return 0;
    }
    Node *raw = speed->node, *lowered = speed->node + 6 * speed->room + 4;
    const size_t n = lower_tops(stretch, raw, make_nodes(speed, raw), lowered);
    if (!keeps_ends(stretch, lowered, n)) {
        return 0;
    }
    speed->nodes = n;
    make_phases(speed, lowered, n);
    speed->before = stretch->v0 > 0 ? 0 : stretch->T / 2;
    speed->behind = stretch->v1 > 0 ? 0 : stretch->T / 2;
    speed->duration = speed->unfiltered + speed->before + speed->behind;
    return 1;
}

/* --- the mean over T */

#define FEW_PHASES 16

/* Phase at t; `phases` behind the last one. */
static size_t find_phase(const Speed *speed, double t, size_t hint) {
    const Phase *phase = speed->phase;
    size_t k = hint < speed->phases ? hint : speed->phases;
    while (k > 0 && phase[k].t > t) {
        k--;
    }
    while (k < speed->phases && phase[k + 1].t <= t) {
        k++;
    }
    return k;
}

typedef struct Point {
    double s, v, a, S, S_rest;
} Point;

static Point unfiltered_at(const Speed *speed, double t, size_t *hint) {
    if (t < 0) { /* constant speed ahead of the begin */
        return (Point){speed->v0 * t, speed->v0, 0, speed->v0 * t * t / 2, 0};
    }
    *hint = find_phase(speed, t, *hint);
    const Phase *p = &speed->phase[*hint];
    const double d = t - p->t;
    Point point = {p->s + d * (p->v + d * p->a / 2), p->v + d * p->a, p->a, p->S, p->S_rest};
    two_sum(&point.S, &point.S_rest, d * (p->s + d * (p->v / 2 + d * p->a / 6)));
    return point;
}

void motion_at(const Speed *speed, double t, size_t hint[2], double q[4]) {
    const double T = speed->T, middle = t - speed->before;
    const Point end = unfiltered_at(speed, middle + T / 2, &hint[1]);
    if (!(T > 0)) {
        q[0] = end.s;
        q[1] = end.v;
        q[2] = end.a;
        q[3] = 0;
        return;
    }
    const double t0 = middle - T / 2, t1 = middle + T / 2;
    const Point begin = unfiltered_at(speed, t0, &hint[0]);
    const size_t first = t0 < 0 ? 0 : hint[0];
    if (hint[1] - first > FEW_PHASES) {
        q[0] = ((end.S - begin.S) + (end.S_rest - begin.S_rest)) / T;
    } else { /* long phases: what they add to the place of the begin is exact to more digits than their integrals are */
        double sum = 0, at = t0, s = begin.s, v = begin.v, a = begin.a;
        size_t k = t0 < 0 ? SIZE_MAX : first;
        for (;;) {
            const bool last = k == hint[1];
            const double d = (last ? t1 : speed->phase[k + 1].t) - at;
            sum += d * ((s - begin.s) + d * (v / 2 + d * a / 6));
            if (last) {
                break;
            }
            const Phase *p = &speed->phase[++k];
            at = p->t;
            s = p->s;
            v = p->v;
            a = p->a;
        }
        q[0] = begin.s + sum / T;
    }
    q[1] = (end.s - begin.s) / T;
    q[2] = (end.v - begin.v) / T;
    q[3] = (end.a - begin.a) / T;
}

double time_at(const Speed *speed, double q, size_t hint[2]) {
    double low = 0, high = speed->duration, state[4];
    if (q <= 0) {
        return 0;
    }
    if (q >= speed->q1 - speed->q0) {
        return high;
    }
    /* When the unfiltered motion is there; the mean is there at most T/2 earlier or later. */
    size_t first = 0, last = speed->phases;
    while (first < last) {
        const size_t middle = (first + last + 1) / 2;
        if (speed->phase[middle].s <= q) {
            first = middle;
        } else {
            last = middle - 1;
        }
    }
    const Phase *p = &speed->phase[first];
    const double root = sqrt(fmax(p->v * p->v + 2 * p->a * (q - p->s), 0));
    double t = p->t + (p->v + root > 0 ? 2 * (q - p->s) / (p->v + root) : 0) + speed->before;
    low = fmax(low, t - speed->T / 2);
    high = fmin(high, t + speed->T / 2);
    hint[0] = hint[1] = first;
    for (int step = 0; step < 60 && high - low > 1e-13; step++) {
        t = t >= low && t <= high ? t : (low + high) / 2;
        motion_at(speed, t, hint, state);
        const double over = state[0] - q;
        if (over > 0) {
            high = t;
        } else {
            low = t;
        }
        const double next = state[1] > 0 ? t - over / state[1] : (low + high) / 2;
        if (fabs(next - t) < 1e-12) {
            return next;
        }
        t = next > low && next < high ? next : (low + high) / 2;
    }
    return t;
}
