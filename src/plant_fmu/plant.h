/* What the rooms of the plant share: derived data and the layout of the state. */
#ifndef FEEDSIM_PLANT_H
#define FEEDSIM_PLANT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "geometry.h"
#include "guide.h"
#include "modal.h"
#include "modes.h"
#include "poses.h"
#include "transmission.h"
#include "unit.h"

#define plant_load PREFIXED(plant_load)
#define plant_release PREFIXED(plant_release)
#define plant_table PREFIXED(plant_table)
#define plant_derive PREFIXED(plant_derive)
#define plant_accepts PREFIXED(plant_accepts)

#define NO_AXIS ((size_t)-1)

/* Derived data. Ports of the modal systems: the axes' n, the tool's directions, the axes' x. A torque or force acts at
 * each. */
typedef struct Plant {
    size_t axes;
    const char **axis_names;           /* [axes] */
    size_t tool_axis[TOOL_DIRECTIONS]; /* axis named like the direction, or NO_AXIS */
    double *archive;                   /* the archive's mode table, rows as modes_read() leaves them */
    size_t archive_modes;
    uint64_t archive_hash;
    Poses poses;          /* the archive's grid of poses; no cells where it has none */
    double *pose_numbers; /* that it consists of */

    bool ready;              /* what follows is set */
    char table[STRING_SIZE]; /* modes_file that the modal systems were made from */
    uint64_t table_hash;     /* of the table's bytes */
    size_t cells;            /* modal systems; 1: one pose */
    size_t size;             /* modes of each, padded, so that the state fits them all */
    Modal *modal;            /* [cells] */
    double *systems;         /* their memory */
    double *memory;          /* of what follows: scratch of a step */
    double *u, *du;          /* [ports] */
    double *y, *y_before;    /* [ports] */
    double *x;               /* [axes] positions */
    double *carried;         /* [cells_scratch()] */

    bool errors; /* play or geometry: what follows counts */
    Geometry geometry;

    bool guided; /* friction at a guide: what follows counts */
    Guide *guides;
    double *v_free;        /* [axes] speeds of the slides without it */
    double *held, *ramp;   /* [axes][axes] mobilities of the slides, for */
    const Modal *mobility; /* this modal system */
    double mobility_h;     /* and this step */

    bool driven; /* a motor with a transmission: what follows counts */
    Transmission *transmissions;
    double *motor_u, *motor_du;   /* [axes] torques on the motors */
    double *angle_free, *n_free;  /* [axes] the structure at their ports without them */
    double *by_angle, *by_n;      /* [axes][axes] what their torques add there, for */
    const Modal *transmitted;     /* this modal system */
    double transmitted_h;         /* and this step */
    double *q_free, *v_free_step; /* [size] */
} Plant;

/* State block: this head, then two places by turns for inputs at the end of the last step [ports], q [size], v [size],
 * with play or geometry, ways of the slides since the start, what play takes off or adds, and the wind-up of the
 * hysteresis [axes] each, and a GuideState and a TransmissionState per axis: a step leaves its result in the other one,
 * which counts once it is known to be sound. */
typedef struct StateHead {
    uint64_t table_hash; /* mode table that the state belongs to */
    uint64_t cell;       /* whose modes q and v belong to */
    uint64_t place;      /* that counts, 0 or 1 */
} StateHead;

enum {
    GUIDE_DOUBLES = sizeof(GuideState) / sizeof(double),
    TRANSMISSION_DOUBLES = sizeof(TransmissionState) / sizeof(double)
};

/* The first of the ports at the slides. */
static inline size_t plant_slides(const Plant *plant) {
    return plant->axes + TOOL_DIRECTIONS;
}

static inline size_t plant_ports(const Plant *plant) {
    return plant_slides(plant) + plant->axes;
}

static inline size_t plant_state_doubles(const Plant *plant) {
    return plant_ports(plant) + 2 * plant->size + (3 + GUIDE_DOUBLES + TRANSMISSION_DOUBLES) * plant->axes;
}

/* --- load.c: the archive */
bool plant_load(Unit *unit);
void plant_release(Unit *unit);
/* Mode table of a text as values (see modes.h), to be freed with unit_free(); NULL with the fault logged. */
double *plant_table(Unit *unit, const Plant *plant, const char *text, size_t size, const char *source, size_t *modes);

/* --- derive.c: modal systems from the archive or from modes_file */
bool plant_derive(Unit *unit);
bool plant_accepts(Unit *unit, const Scalars *scalars, const void *state, size_t size);

#endif
