#include "planner.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "path.h"
#include "speed.h"

#define TEXT_OF(number) #number
#define TEXT(number) TEXT_OF(number)
#define FIELD_TEXT(type, name) " " #type " " #name ","

const char *planner_interface(void) {
    return TEXT(PLANNER_VERSION) ":" PLANNER_FIELDS(FIELD_TEXT);
}

#define WINDOW 2000      /* zones that are looked at together */
#define LEAST_SHARE 0.35 /* share of acceleration and jerk for the curvature, at least.. */
#define LARGEST_SHARE 0.998
#define LIMIT_KINDS 6

/* What is kept of a section: what it is planned from, and what makes its zones again. */
typedef struct Section {
    double begin, duration; /* [s] */
    double T, share;
    double v0, v1;
    int64_t element, index; /* its first zone (path.h) */
    double element_s;
    int64_t zones;
    int64_t rows[2];
} Section;

struct Planner {
    Program program;
    Builder builder;
    Zones zones;
    Speed speed;
    size_t window;
    bool begun, ends; /* there is a window; it ends with a stop */
    double v0;        /* speed at its begin */
    double t;         /* where planning has come to [s] */
    int64_t row;      /* the next row that is not in a window */
    double s;         /* place on the programmed path ahead of it */
    double longest_T; /* a / j of the axes [s] */
    double T, share;  /* of the window before */
    Section *section;
    size_t sections, room;
    double begin, stops; /* of the motion that is being planned: when it began, how long it takes with stops [s] */
    int64_t rounded;     /* its rounded corners */
    double with_roundings, with_stops; /* of motions that would be shorter with stops [s] */
    int64_t corners;
    int64_t held_row;                           /* row whose limits are being counted */
    double held[LIMIT_KINDS][PLANNER_AXES + 1]; /* time by limit and axis */
    /* for sampling */
    Builder again;
    Zones zones_again;
    Speed speed_again;
    size_t sampled;
};

Planner *planner_create(const Program *program) {
    Planner *planner = calloc(1, sizeof *planner);
    if (planner == NULL) {
        return NULL;
    }
    planner->program = *program;
    planner->builder.program = planner->again.program = &planner->program;
    planner->sampled = SIZE_MAX;
    planner->held_row = -1;
    const Program *p = &planner->program;
    for (int64_t i = 0; i < p->axes; i++) {
        bool moved = i == p->space_x || i == p->space_y || i == p->space_z;
        for (int64_t row = 0; row < p->rows && !moved; row++) {
            moved = p->end[row * p->axes + i] != p->start[i];
        }
        const double T = p->max_acceleration[i] / p->max_jerk[i];
        if (moved && T > planner->longest_T) {
            planner->longest_T = T;
        }
    }
    return planner;
}

void planner_destroy(Planner *planner) {
    if (planner != NULL) {
        builder_free(&planner->builder);
        builder_free(&planner->again);
        zones_free(&planner->zones);
        zones_free(&planner->zones_again);
        speed_free(&planner->speed);
        speed_free(&planner->speed_again);
        free(planner->section);
        free(planner);
    }
}

/* The next instant at which a motion may begin. */
static double on_grid(const Program *p, double t) {
    return p->grid > 0 ? fmax(ceil(t / p->grid - 1e-9), 0) * p->grid : t;
}

/* --- the best filter time and share */

static double middle_of(const Zone *z) {
    return z->q + z->length / 2;
}

static Stretch stretch_of(const Program *p, const Zones *zones, size_t from, size_t to, double v0, double v1) {
    const Zone *first = &zones->zone[from], *last = &zones->zone[to];
    return (Stretch){
        .program = p,
        .zone = first,
        .derivatives = zones->derivatives,
        .count = to - from + 1,
        .q0 = v0 > 0 ? middle_of(first) : first->q,
        .q1 = v1 > 0 ? middle_of(last) : last->q + last->length,
        .v0 = v0,
        .v1 = v1,
        .soft = p->jerk_limited[first->row],
    };
}

/* Duration [s] with this filter time and share; HUGE_VAL where it does not hold, negative without memory. */
static double try_duration(Stretch *stretch, Speed *speed, double T, double share) {
    stretch->T = stretch->soft ? T : 0;
    stretch->share = share;
    const int held = plan_speed(stretch, speed);
    return held < 0 ? -1 : (held ? speed->duration : HUGE_VAL);
}

/* Look for the shortest duration around *T and *share, step by step smaller. False without memory. */
static bool refine(Stretch *stretch, Speed *speed, double longest_T, int trials, double *T, double *share,
                   double *best) {
    double step_T = 1.6, step_share = 0.2;
    while (trials > 0 && step_T > 1.03) {
        bool better = false;
        for (int way = 0; way < 4 && trials > 0; way++) {
            const double t = way == 0 ? fmin(*T * step_T, longest_T) : (way == 1 ? *T / step_T : *T);
            const double g = way == 2   ? fmin(*share + step_share, LARGEST_SHARE)
                             : way == 3 ? fmax(*share - step_share, LEAST_SHARE)
                                        : *share;
            if ((t == *T && g == *share) || (way < 2 && !stretch->soft)) {
                continue;
            }
            const double duration = try_duration(stretch, speed, t, g);
            trials--;
            if (duration < 0) {
                return false;
            }
            if (duration < *best * (1 - 1e-9)) {
                *best = duration;
                *T = t;
                *share = g;
                better = true;
                way |= 1; /* not back again */
            }
        }
        if (!better) {
            step_T = sqrt(step_T);
            step_share /= 2;
        }
    }
    return true;
}

/* A straight line from rest to rest: seven phases of constant jerk, of which the filter time is the first. */
static double filter_time_of_line(const Zone *z, double longest_T) {
    const double a = fmin(z->a_line, z->a_path), j = fmin(z->j_line, z->j_path);
    double V = HUGE_VAL;
    for (int b = 0; b < BOUND_COUNT; b++) {
        V = fmin(V, z->V[b]);
    }
    if (!(j < HUGE_VAL)) {
        return 0;
    }
    return fmin(fmin(fmin(a / j, longest_T), sqrt(V / j)), cbrt(z->length / (2 * j)));
}

/* The best *T and *share of a stretch, from those given on; thorough: look far. False without memory. */
static bool find_best(Stretch *stretch, Speed *speed, double longest_T, bool thorough, double *T, double *share,
                      double *best) {
    if (stretch->count == 1 && stretch->zone->intervals == 0 && stretch->v0 == 0 && stretch->v1 == 0) {
        *T = filter_time_of_line(stretch->zone, HUGE_VAL);
        *best = try_duration(stretch, speed, *T, *share);
        return *best >= 0;
    }
    *best = try_duration(stretch, speed, *T, *share);
    if (*best < 0) {
        return false;
    }
    if (thorough) {
        const double factor[] = {1, 0.5, 0.25, 0.12};
        for (size_t k = 0; k < sizeof factor / sizeof *factor && stretch->soft; k++) {
            const double t = longest_T * factor[k];
            const double duration = try_duration(stretch, speed, t, *share);
            if (duration < 0) {
                return false;
            }
            if (duration < *best) {
                *best = duration;
                *T = t;
            }
        }
    }
    return refine(stretch, speed, longest_T, thorough ? 16 : 12, T, share, best);
}

/* --- what holds a row back */

static void close_row(Planner *planner) {
    if (planner->held_row < 0) {
        return;
    }
    double most = 0;
    for (int kind = 1; kind < LIMIT_KINDS; kind++) {
        for (int axis = 0; axis <= PLANNER_AXES; axis++) {
            if (planner->held[kind][axis] > most) {
                most = planner->held[kind][axis];
                planner->program.limit_kind[planner->held_row] = (int8_t)kind;
                planner->program.limit_axis[planner->held_row] = (int8_t)(axis - 1);
            }
        }
    }
    memset(planner->held, 0, sizeof planner->held);
    planner->held_row = -1;
}

static void limit_in(const Stretch *stretch, const Speed *speed, const Cell *cell, const Node *node, int *kind,
                     int *axis) {
    const Zone *z = &stretch->zone[cell->V_zone], *of_A = &stretch->zone[cell->A_zone];
    const bool lowered = node->w < cell->V2 * (1 - 1e-9);
    if (node->a != 0 || lowered) {
        zone_acceleration(stretch, of_A, speed->V[cell->A_zone], kind, axis);
        *kind = lowered && node->a == 0 ? 4 : *kind;
        return;
    }
    Bound bound = BOUND_FEED;
    zone_speed(stretch, z, &bound);
    const int kinds[BOUND_COUNT] = {1, 2, 3, 4, 5};
    *kind = z->kind != ZONE_ELEMENT && bound > BOUND_SPEED ? 5 : kinds[bound];
    *axis = z->V_axis[bound];
}

static void count_limits(Planner *planner, const Stretch *stretch) {
    const Speed *speed = &planner->speed;
    const Node *node = speed->node + 6 * speed->room + 4;
    size_t cell = 0, zone = 0;
    for (size_t k = 0; k + 1 < speed->nodes; k++) {
        double q = node[k].s;
        const double until = node[k + 1].s;
        double v = sqrt(node[k].w);
        int kind = 0, axis = -1;
        size_t counted = SIZE_MAX;
        while (q < until) {
            while (cell + 1 < speed->cells && speed->cell[cell + 1].q <= q) {
                cell++;
            }
            while (zone + 1 < stretch->count && stretch->zone[zone].q + stretch->zone[zone].length <= q) {
                zone++;
            }
            const Zone *z = &stretch->zone[zone];
            const bool behind = z->kind != ZONE_ELEMENT && q >= middle_of(z);
            double next = z->kind != ZONE_ELEMENT && !behind ? middle_of(z) : z->q + z->length;
            next = zone + 1 < stretch->count || next > q ? next : until;
            if (cell + 1 < speed->cells) {
                next = fmin(next, speed->cell[cell + 1].q);
            }
            next = fmin(next > q ? next : nextafter(q, HUGE_VAL), until);
            if (counted != cell) {
                limit_in(stretch, speed, &speed->cell[cell], &node[k], &kind, &axis);
                counted = cell;
            }
            const int64_t row = behind ? z->row_end : z->row;
            if (row != planner->held_row) {
                close_row(planner);
                planner->held_row = row;
            }
            const double v_next = sqrt(fmax(node[k].w + 2 * node[k].a * (next - node[k].s), 0));
            planner->held[kind][axis + 1] += v + v_next > 0 ? 2 * (next - q) / (v + v_next) : 0;
            v = v_next;
            q = next;
        }
    }
}

/* --- sections */

/* Rows between row and next, and those without length in between, meet at t. */
static void meet(Planner *planner, int64_t row, int64_t next, double t) {
    const Program *p = &planner->program;
    p->end_time[row] = t;
    for (int64_t i = row + 1; i < next; i++) {
        p->start_time[i] = p->end_time[i] = t;
    }
    p->start_time[next] = t;
}

/* Place on the programmed path at a share of the zone. */
static double place_on_program(const Zone *z, double share) {
    if (z->kind == ZONE_ELEMENT) {
        return z->s0 + (z->s1 - z->s0) * share;
    }
    return share < 0.5 ? z->s0 + (z->s_vertex - z->s0) * 2 * share
                       : z->s_vertex + (z->s1 - z->s_vertex) * (2 * share - 1);
}

/* The share of the zone that lies ahead of a place on the programmed path. */
static double share_of_zone(const Zone *z, double s) {
    if (z->kind == ZONE_ELEMENT) {
        return s > z->s0 ? (s - z->s0) / (z->s1 - z->s0) : 0;
    }
    if (s == z->s_vertex) {
        return 0.5;
    }
    return s < z->s_vertex ? 0.5 * (s - z->s0) / (z->s_vertex - z->s0)
                           : 0.5 + 0.5 * (s - z->s_vertex) / (z->s1 - z->s_vertex);
}

/* Let rows meet in the zones of a stretch: where an element of another row begins, at the vertex of a corner, and
 * within corners of splines on either side of it. */
static void meet_rows(Planner *planner, const Stretch *stretch) {
    size_t hint[2] = {0, 0};
    int64_t row = -1;
    for (size_t k = 0; k < stretch->count; k++) {
        const Zone *z = &stretch->zone[k];
        double from = z->s0, end = z->s1;
        int64_t next = z->kind == ZONE_CORNER ? row_in_corner(&planner->program, z, from, &end) : z->row;
        for (;;) {
            if (next > row) {
                const double share = share_of_zone(z, from), q = z->q + z->length * share;
                if (row >= 0 && q >= stretch->q0 && (q < stretch->q1 || stretch->v1 == 0)) {
                    meet(planner, row, next, planner->t + time_at(&planner->speed, q - stretch->q0, hint));
                }
                row = next;
            }
            if (z->kind == ZONE_ELEMENT || (end >= z->s1 && (z->kind == ZONE_CORNER || row == z->row_end))) {
                break;
            }
            from = end;
            next = row_in_corner(&planner->program, z, from, &end);
        }
    }
}

static bool add_section(Planner *planner, const Stretch *stretch, double T, double share) {
    if (planner->sections == planner->room) {
        const size_t room = planner->room ? 2 * planner->room : 64;
        Section *moved = realloc(planner->section, room * sizeof *moved);
        if (moved == NULL) {
            return false;
        }
        planner->section = moved;
        planner->room = room;
    }
    const Speed *speed = &planner->speed;
    const Zone *first = stretch->zone, *last = first + stretch->count - 1;
    planner->section[planner->sections++] = (Section){
        .begin = planner->t,
        .duration = speed->duration,
        .T = T,
        .share = share,
        .v0 = stretch->v0,
        .v1 = stretch->v1,
        .element = first->element,
        .index = first->index,
        .element_s = first->element_s,
        .zones = (int64_t)stretch->count,
        .rows = {stretch->v0 > 0 ? first->row_end : first->row, last->row},
    };
    if (stretch->v0 == 0) {
        planner->program.start_time[first->row] = planner->t;
    }
    meet_rows(planner, stretch);
    count_limits(planner, stretch);
    planner->t += speed->duration;
    if (stretch->v1 == 0) {
        const Program *p = &planner->program;
        p->end_time[last->row_end] = planner->t;
        for (int64_t i = last->row_end + 1; i < next_row(p, i); i++) {
            p->start_time[i] = p->end_time[i] = planner->t;
        }
    }
    return true;
}

/* The zone of the window at whose middle a section may end: its speed is reached and stays for T/2 on either side.
 * valley: it is slower than what lies around. Returns the number of zones found, in `cut`. */
static size_t find_cuts(const Stretch *stretch, const Speed *speed, bool valley, int32_t *cut) {
    const Node *node = speed->node + 6 * speed->room + 4;
    size_t count = 0, flat = 0;
    for (size_t k = 1; k + 1 < stretch->count; k++) {
        const Zone *z = &stretch->zone[k];
        if (!z->restarts) {
            continue;
        }
        const double q = middle_of(z), V = speed->V[k], half = V * stretch->T / 2 * (1 - 1e-9);
        while (flat + 1 < speed->nodes && node[flat + 1].s <= q) {
            flat++;
        }
        size_t from = flat, to = flat;
        while (from > 0 && node[from].s > q - half && node[from - 1].a == 0) {
            from--;
        }
        while (to + 1 < speed->nodes && node[to].a == 0) {
            to++;
            if (!valley && node[to].s > q + half) {
                break;
            }
        }
        const bool reached = fabs(node[from].w - V * V) <= 1e-12 * V * V;
        if (!reached || node[from].s > q - half || node[to].s < q + half ||
            (stretch->T == 0 && from == to && node[from].s != q)) {
            continue;
        }
        if (valley) {
            while (from > 0 && node[from - 1].a == 0) {
                from--;
            }
            if (from == 0 || node[from - 1].a >= 0 || to + 1 >= speed->nodes || node[to].a <= 0) {
                continue;
            }
            if (count > 0 && middle_of(&stretch->zone[cut[count - 1]]) >= node[from].s) {
                continue; /* the same valley */
            }
        }
        cut[count++] = (int32_t)k;
    }
    return count;
}

/* Let q count from the first of these zones: a section that is made again then has the same bits. */
static void count_from(Zone *zone, size_t count) {
    double q = 0;
    for (size_t k = 0; k < count; k++) {
        zone[k].q = q;
        q += zone[k].length;
    }
}

/* Plan the zones from..to of the window as a section. False without memory. */
static bool plan_section(Planner *planner, size_t from, size_t to, double v0, double v1) {
    count_from(&planner->zones.zone[from], to - from + 1);
    Stretch stretch = stretch_of(&planner->program, &planner->zones, from, to, v0, v1);
    double T = planner->T, share = planner->share, best;
    if (!find_best(&stretch, &planner->speed, planner->longest_T, false, &T, &share, &best)) {
        return false;
    }
    const double duration = try_duration(&stretch, &planner->speed, T, share);
    return duration >= 0 && add_section(planner, &stretch, stretch.T, share);
}

/* Forget the zones ahead of the one that the next section begins in. */
static void drop_zones(Zones *zones, size_t from) {
    size_t kept = zones->used;
    for (size_t k = from; k < zones->count; k++) {
        if (zones->zone[k].intervals > 0) {
            kept = zones->zone[k].derivatives;
            break;
        }
    }
    memmove(zones->zone, zones->zone + from, (zones->count - from) * sizeof *zones->zone);
    if (zones->used > kept) {
        memmove(zones->derivatives, zones->derivatives + kept, (zones->used - kept) * sizeof *zones->derivatives);
    }
    zones->count -= from;
    zones->used -= kept;
    count_from(zones->zone, zones->count);
    for (size_t k = 0; k < zones->count; k++) {
        zones->zone[k].derivatives -= zones->zone[k].intervals > 0 ? kept : 0;
    }
}

/* Add how long the next element takes from rest to rest. False without memory. */
static bool add_stops(Planner *planner) {
    Zones *zones = &planner->zones_again;
    zones->count = zones->used = 0;
    planner->sampled = SIZE_MAX;
    if (!builder_alone(&planner->builder, zones)) {
        return false;
    }
    count_from(zones->zone, zones->count);
    Stretch stretch = stretch_of(&planner->program, zones, 0, zones->count - 1, 0, 0);
    double T = planner->longest_T, share = 0.65, duration;
    if (!find_best(&stretch, &planner->speed_again, planner->longest_T, false, &T, &share, &duration)) {
        return false;
    }
    planner->stops += on_grid(&planner->program, duration);
    return true;
}

/* Fill the window up; false without memory. */
static bool fill_window(Planner *planner) {
    Zones *zones = &planner->zones;
    while (!planner->ends && zones->count < planner->window) {
        size_t from = zones->count;
        if (!add_stops(planner) || !builder_next(&planner->builder, zones, &planner->ends)) {
            return false;
        }
        double q = from > 0 ? zones->zone[from - 1].q + zones->zone[from - 1].length : 0;
        for (; from < zones->count; from++) {
            planner->rounded += zones->zone[from].kind == ZONE_CORNER;
            zones->zone[from].q = q;
            q += zones->zone[from].length;
        }
    }
    return true;
}

/* Rows from a stop on: those without length, dwells; then the motion begins on the grid. */
static bool begin_motion(Planner *planner) {
    const Program *p = &planner->program;
    for (;;) {
        const int64_t next = next_row(p, planner->row);
        for (; planner->row < next; planner->row++) {
            p->start_time[planner->row] = p->end_time[planner->row] = planner->t;
        }
        if (next >= p->rows) {
            planner->begun = false;
            return true;
        }
        planner->t = on_grid(p, planner->t);
        if (p->motion[next] != 3) {
            break;
        }
        p->start_time[next] = planner->t;
        planner->t += p->dwell[next];
        p->end_time[next] = planner->t;
        planner->row = next + 1;
    }
    planner->begun = true;
    planner->ends = false;
    planner->v0 = 0;
    planner->begin = planner->t;
    planner->stops = 0;
    planner->rounded = 0;
    planner->T = planner->longest_T;
    planner->share = 0.65;
    planner->zones.count = planner->zones.used = 0;
    planner->window = WINDOW;
    return builder_begin(&planner->builder, planner->row, planner->s);
}

int planner_advance(Planner *planner, int64_t *rows) {
    const Program *p = &planner->program;
    if (!planner->begun && (!begin_motion(planner))) {
        return PLANNER_OUT_OF_MEMORY;
    }
    *rows = planner->row;
    if (!planner->begun) {
        return PLANNER_DONE;
    }
    Zones *zones = &planner->zones;
    if (!fill_window(planner)) {
        return PLANNER_OUT_OF_MEMORY;
    }
    Stretch whole = stretch_of(p, zones, 0, zones->count - 1, planner->v0, 0);
    double best;
    if (!find_best(&whole, &planner->speed, planner->longest_T, planner->v0 == 0, &planner->T, &planner->share,
                   &best) ||
        try_duration(&whole, &planner->speed, planner->T, planner->share) < 0) {
        return PLANNER_OUT_OF_MEMORY;
    }
    int32_t *cut = malloc(zones->count * sizeof *cut);
    double *V = malloc(zones->count * sizeof *V);
    bool held = cut != NULL && V != NULL;
    if (held) {
        memcpy(V, planner->speed.V, zones->count * sizeof *V);
        size_t cuts = find_cuts(&whole, &planner->speed, true, cut);
        if (cuts == 0 && !planner->ends) {
            cuts = find_cuts(&whole, &planner->speed, false, cut);
            if (cuts > 0) {
                cut[0] = cut[cuts - 1];
                cuts = 1;
            }
        }
        if (cuts == 0 && !planner->ends) {
            planner->window *= 2;
        }
        size_t from = 0;
        double v = planner->v0;
        for (size_t k = 0; k < cuts && held; k++) {
            held = plan_section(planner, from, (size_t)cut[k], v, V[cut[k]]);
            from = (size_t)cut[k];
            v = V[from];
        }
        if (planner->ends) {
            held = held && plan_section(planner, from, zones->count - 1, v, 0);
            planner->row = planner->builder.row;
            planner->s = planner->builder.s;
            planner->begun = false;
            close_row(planner);
            const double taken = on_grid(p, planner->t) - planner->begin;
            if (held && planner->rounded > 0 && planner->stops < taken * (1 - 1e-9)) {
                planner->with_roundings += taken;
                planner->with_stops += planner->stops;
                planner->corners += planner->rounded;
            }
        } else if (cuts > 0) {
            planner->row = zones->zone[from].row_end;
            planner->v0 = v;
            drop_zones(zones, from);
            planner->window = WINDOW;
        }
        *rows = planner->row;
    }
    free(cut);
    free(V);
    return held ? PLANNER_MORE : PLANNER_OUT_OF_MEMORY;
}

double planner_duration(const Planner *planner, double saved[2], int64_t *corners) {
    saved[0] = planner->with_roundings;
    saved[1] = planner->with_stops;
    *corners = planner->corners;
    return planner->t;
}

int64_t planner_sections(const Planner *planner) {
    return (int64_t)planner->sections;
}

void planner_section(const Planner *planner, int64_t k, int64_t rows[2], double values[4]) {
    const Section *section = &planner->section[k];
    rows[0] = section->rows[0];
    rows[1] = section->rows[1];
    values[0] = section->begin;
    values[1] = section->duration;
    values[2] = section->T;
    values[3] = section->share;
}

/* --- sampling */

/* Make the zones of section k and its motion again. */
static bool plan_again(Planner *planner, size_t k) {
    const Section *section = &planner->section[k];
    Zones *zones = &planner->zones_again;
    zones->count = zones->used = 0;
    if (!builder_begin(&planner->again, section->element, section->element_s)) {
        return false;
    }
    bool stops = false, held = true;
    size_t first = 0;
    zones->skipped = section->element;
    zones->skipped_pieces = section->index;
    zones->enough = (size_t)section->zones;
    do {
        held = builder_next(&planner->again, zones, &stops);
        while (first < zones->count && zones->zone[first].element == section->element &&
               zones->zone[first].index < section->index) {
            first++;
        }
    } while (held && zones->count < first + (size_t)section->zones && !stops);
    zones->enough = 0;
    if (!held) {
        return false;
    }
    drop_zones(zones, first);
    Stretch stretch = stretch_of(&planner->program, zones, 0, (size_t)section->zones - 1, section->v0, section->v1);
    planner->sampled = k;
    return try_duration(&stretch, &planner->speed_again, section->T, section->share) >= 0;
}

int planner_sample(Planner *planner, int64_t n, const double t[], double x[], int64_t row[], double s[], double v[],
                   double a[], double j[], double parameter[]) {
    const size_t axes = (size_t)planner->program.axes;
    size_t k = 0, hint[2] = {0, 0}, zone = 0;
    if (planner->sections == 0) {
        for (int64_t at = 0; at < n; at++) {
            memcpy(x + (size_t)at * axes, planner->program.start, axes * sizeof *x);
        }
    }
    if (n > 0 && planner->sections > 0) { /* the last section that has begun */
        size_t first = 0, last = planner->sections - 1;
        while (first < last) {
            const size_t middle = (first + last + 1) / 2;
            if (planner->section[middle].begin <= t[0]) {
                first = middle;
            } else {
                last = middle - 1;
            }
        }
        k = first;
    }
    for (int64_t at = 0; at < n && planner->sections > 0; at++) {
        while (k + 1 < planner->sections && planner->section[k + 1].begin <= t[at]) {
            k++;
        }
        if (planner->sampled != k) {
            if (!plan_again(planner, k)) {
                planner->sampled = SIZE_MAX;
                return PLANNER_OUT_OF_MEMORY;
            }
            hint[0] = hint[1] = 0;
            zone = 0;
        }
        const Section *section = &planner->section[k];
        const Speed *speed = &planner->speed_again;
        const double local = fmin(fmax(t[at] - section->begin, 0), section->duration);
        double q[4];
        motion_at(speed, local, hint, q);
        if (t[at] - section->begin > section->duration || t[at] < section->begin) {
            q[1] = q[2] = q[3] = 0;
        }
        const double place = q[0] + speed->q0;
        const Zone *z = planner->zones_again.zone;
        const size_t last = (size_t)section->zones - 1;
        while (zone < last && z[zone].q + z[zone].length <= place) {
            zone++;
        }
        while (zone > 0 && z[zone].q > place) {
            zone--;
        }
        z += zone;
        double d[4][PLANNER_AXES];
        const double inside = fmin(fmax(place - z->q, 0), z->length);
        const double u = z->length > 0 ? z->u0 + (z->u1 - z->u0) * (inside / z->length) : z->u0;
        const bool derivatives = v != NULL || a != NULL || j != NULL;
        curve_at(&z->curve, axes, u, derivatives ? 3 : 0, d);
        memcpy(x + (size_t)at * axes, d[0], axes * sizeof *x);
        if (row != NULL) {
            double end;
            const double share = z->length > 0 ? inside / z->length : 0.5;
            s[at] = place_on_program(z, share);
            row[at] = z->kind == ZONE_ELEMENT ? z->row : row_in_corner(&planner->program, z, s[at], &end);
        }
        if (parameter != NULL) {
            memcpy(parameter + 5 * at, q, sizeof q);
            parameter[5 * at + 4] = fmin(inside, z->length - inside);
        }
        if (derivatives && z->length > 0) {
            const double r = q[1] / z->curve.c, r2 = q[2] / z->curve.c, r3 = q[3] / z->curve.c; /* of u by time */
            for (size_t i = 0; i < axes; i++) {
                const size_t to = (size_t)at * axes + i;
                if (v != NULL) {
                    v[to] = d[1][i] * r;
                }
                if (a != NULL) {
                    a[to] = d[1][i] * r2 + d[2][i] * r * r;
                }
                if (j != NULL) {
                    j[to] = d[1][i] * r3 + 3 * d[2][i] * r * r2 + d[3][i] * r * r * r;
                }
            }
        }
    }
    return PLANNER_DONE;
}
