/* The path planner: rows of an NC program -> a motion along them that keeps speed, acceleration and jerk of every axis.
 *
 * The program is planned in sections, one after the other, from rest or from a place of constant speed to the next one.
 * What is kept of a section is a few numbers; its zones are made anew when it is sampled. So memory depends on the
 * longest stretch without such a place, not on the length of the program. The columns belong to the caller, who keeps
 * them until planner_destroy. No globals, no printing. SI units.
 *
 * The master reads the layout below as text and leaves a library alone that has another one. */
#ifndef FEEDSIM_PLANNER_H
#define FEEDSIM_PLANNER_H

#include <stdint.h>

/* To be counted up when a field comes to mean something else though the tables below stay. */
#define PLANNER_VERSION 1

#define PLANNER_AXES 9 /* at most */

typedef const double *doubles;
typedef const int8_t *bytes;
typedef double *times;
typedef int8_t *codes;

/* The program and the machine. Columns have an entry per row, `end` one per row and axis, `centre` and `normal` three
 * per row, in the space of X, Y, Z. `space` has the place of X, Y and Z among the axes, -1 where there is none.
 *
 *   motion       0 rapid, 1 line, 2 arc, 3 dwell
 *   blending     at the end of the row: 0 exact stop, 1 permitted jump of speed, 2 parabola with legs `tolerance`,
 *                3 quintic within `tolerance`
 *   speed_jump   permitted jump of speed of each axis at a corner [m/s]
 *   step_time    permitted step of acceleration of an axis: its jerk times this [s]
 *   grid         after a stop the motion begins anew at a multiple of it [s]
 *   split_angle  corners above it split a spline [rad]
 *   short_block  longest block that becomes part of a spline [m]
 *   spline_tolerance  largest distance of a spline from the programmed path where a row has none [m]
 *
 * Written: start_time, end_time of every row [s]; limit_kind and limit_axis, what held the row back most of its time:
 * 0 nothing, 1 programmed speed, 2 speed, 3 acceleration, 4 jerk, 5 a corner; the axis, -1 for the path. */
#define PLANNER_FIELDS(F)                                                                                              \
    F(int64_t, rows)                                                                                                   \
    F(int64_t, axes)                                                                                                   \
    F(int64_t, space_x)                                                                                                \
    F(int64_t, space_y)                                                                                                \
    F(int64_t, space_z)                                                                                                \
    F(doubles, start)                                                                                                  \
    F(bytes, motion)                                                                                                   \
    F(doubles, end)                                                                                                    \
    F(doubles, centre)                                                                                                 \
    F(doubles, normal)                                                                                                 \
    F(doubles, angle)                                                                                                  \
    F(doubles, feed)                                                                                                   \
    F(doubles, dwell)                                                                                                  \
    F(bytes, blending)                                                                                                 \
    F(doubles, tolerance)                                                                                              \
    F(bytes, jerk_limited)                                                                                             \
    F(bytes, compressed)                                                                                               \
    F(doubles, max_speed)                                                                                              \
    F(doubles, max_acceleration)                                                                                       \
    F(doubles, max_jerk)                                                                                               \
    F(doubles, speed_jump)                                                                                             \
    F(double, path_acceleration)                                                                                       \
    F(double, path_jerk)                                                                                               \
    F(double, step_time)                                                                                               \
    F(double, grid)                                                                                                    \
    F(double, split_angle)                                                                                             \
    F(double, short_block)                                                                                             \
    F(double, spline_tolerance)                                                                                        \
    F(times, start_time)                                                                                               \
    F(times, end_time)                                                                                                 \
    F(codes, limit_kind)                                                                                               \
    F(codes, limit_axis)

#define PLANNER_FIELD(type, name) type name;
typedef struct Program {
    PLANNER_FIELDS(PLANNER_FIELD)
} Program;

enum { PLANNER_DONE = 0, PLANNER_MORE = 1, PLANNER_OUT_OF_MEMORY = -1 };

#ifdef _WIN32
#define PLANNER_API __declspec(dllexport)
#elif defined(__GNUC__)
#define PLANNER_API __attribute__((visibility("default")))
#else
#define PLANNER_API
#endif

typedef struct Planner Planner;

/* Version and fields in their order: "1: int64_t rows, int64_t axes, ..". */
PLANNER_API const char *planner_interface(void);

/* NULL without memory. */
PLANNER_API Planner *planner_create(const Program *program);
PLANNER_API void planner_destroy(Planner *planner);

/* Plan on, some thousand zones. Returns PLANNER_MORE until all is planned, then PLANNER_DONE, or
 * PLANNER_OUT_OF_MEMORY. *rows: those that are planned. */
PLANNER_API int planner_advance(Planner *planner, int64_t *rows);

/* Duration [s] of what is planned. Of all motions from rest to rest that exact stops at their corners would make
 * shorter: saved[0] [s] as they are, saved[1] [s] with stops, and their number of corners. */
PLANNER_API double planner_duration(const Planner *planner, double saved[2], int64_t *corners);

/* Number of sections; of section k rows that it begins and ends in, begin and duration [s], filter time [s], share of
 * acceleration and jerk that curvature may take. */
PLANNER_API int64_t planner_sections(const Planner *planner);
PLANNER_API void planner_section(const Planner *planner, int64_t k, int64_t rows[2], double values[4]);

/* At n instants t [s], ascending: positions x[n][axes] [m]; where not NULL: row and place s on the programmed path [m]
 * from its beginning; derivatives v, a, j of x by time [n][axes]; of the path's parameter q in its section value, three
 * derivatives by time and the distance to the nearer end of the zone that it lies in [n][5]. Returns PLANNER_DONE or
 * PLANNER_OUT_OF_MEMORY. */
PLANNER_API int planner_sample(Planner *planner, int64_t n, const double t[], double x[], int64_t row[], double s[],
                               double v[], double a[], double j[], double q[]);

#endif
