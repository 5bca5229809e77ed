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
#include "mount.h"
#include "poses.h"
#include "transmission.h"
#include "unit.h"

#define plant_load PREFIXED(plant_load)
#define plant_release PREFIXED(plant_release)
#define plant_table PREFIXED(plant_table)
#define plant_derive PREFIXED(plant_derive)
#define plant_accepts PREFIXED(plant_accepts)
#define plant_measure PREFIXED(plant_measure)
#define plant_measure_tool PREFIXED(plant_measure_tool)
#define plant_positions PREFIXED(plant_positions)
#define plant_play PREFIXED(plant_play)
#define plant_errors_are_numbers PREFIXED(plant_errors_are_numbers)
#define plant_show PREFIXED(plant_show)
#define plant_show_play PREFIXED(plant_show_play)
#define plant_show_tool PREFIXED(plant_show_tool)
#define plant_slide_speed PREFIXED(plant_slide_speed)
#define plant_tool_speed PREFIXED(plant_tool_speed)
#define plant_start_joints PREFIXED(plant_start_joints)
#define plant_substeps PREFIXED(plant_substeps)
#define plant_join PREFIXED(plant_join)
#define plant_follow_joints PREFIXED(plant_follow_joints)
#define plant_show_guides PREFIXED(plant_show_guides)
#define plant_show_transmissions PREFIXED(plant_show_transmissions)

#define plant_read_mounts PREFIXED(plant_read_mounts)
#define plant_free_mounts PREFIXED(plant_free_mounts)
#define plant_derive_mounts PREFIXED(plant_derive_mounts)
#define plant_pace_mounts PREFIXED(plant_pace_mounts)
#define plant_follow_mounts PREFIXED(plant_follow_mounts)
#define plant_show_mounts PREFIXED(plant_show_mounts)

#define NO_AXIS ((size_t)-1)

/* Levelling mounts that are not linear, a port per direction of each; forces beyond the linear springs that the modes
 * hold. They are looked at every few steps and held between, at their mean over that time as the forces at the last
 * looks foretell it. */
typedef struct Mounts {
    size_t ports;              /* 0: the archive has none */
    double *rows;              /* [ports][MOUNT_SHAPE + archive_modes] of its table */
    bool on;                   /* one of them is other than the linear spring; what follows then counts */
    Mount *own;                /* [ports] with the factors */
    Modal at;                  /* their ports: shapes alone */
    double *memory, *x, *held; /* of the shapes; [ports]; [ports] */
    double h;                  /* step that what follows belongs to, 0: none */
    size_t every;              /* steps from one look to the next, 0: no pace is stable */
} Mounts;

/* A row of the table of mounts: the spring of the modes, the element, the modes' shapes there. */
enum { MOUNT_K_LIN, MOUNT_K_E, MOUNT_F_MAX, MOUNT_X_2, MOUNT_K_V, MOUNT_C, MOUNT_SHAPE, MOUNT_LOOKS = 4 };

/* A port of the mounts in a state, all numbers. */
typedef struct MountPort {
    MountState mount;
    double x_before;               /* at the look before the last [m] */
    double force[MOUNT_LOOKS - 1]; /* beyond the linear spring at the last looks, the latest first [N] */
    double held;                   /* until the next one [N] */
} MountPort;

/* Their common part of a state, all numbers. */
typedef struct MountsHead {
    double time[MOUNT_LOOKS - 1]; /* since the last look, and between those before [s] */
    double left;                  /* steps until the next */
    double h;                     /* those steps [s] */
    double block;                 /* that counts, 0 or 1 */
    double E, x_max;
} MountsHead;

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

    bool guided; /* friction at a guide */
    Guide *guides;
    bool driven; /* a motor with a transmission */
    Transmission *transmissions;

    Mounts mounts;

    /* What follows counts where there is a guide or a transmission. */
    Forecast *forecasts;                /* [PORTS_SHOWN][axes], for */
    const Modal *foretold;              /* this modal system */
    double foretold_h;                  /* and this step */
    double *held, *ramp;                /* [axes][axes] mobilities of the slides */
    double *by_way, *by_n;              /* [axes][axes] what torques at the motors' ports add there */
    double *by_way_ramp, *by_n_ramp;    /* [axes][axes] the same of their changes about the mean */
    double *v_free, *way_free, *n_free; /* [axes] slides and motors' ports without these forces */
    double *v, *way, *n;                /* [axes] with some of them */
    double *motor_u, *motor_du;         /* [axes] torques on the motors */
    size_t *acting;                     /* [ports] where forces act, */
    const double **shapes;              /* [ports] the modes' shapes there */
    double *u_acting, *du_acting;       /* [ports] and the forces */
} Plant;

/* State block: this head, then two places by turns for inputs at the end of the last step [ports], q [size], v [size],
 * with play or geometry, ways of the slides since the start, what play takes off or adds, and the wind-up of the
 * hysteresis [axes] each, a GuideState and a TransmissionState per axis, and of mounts a MountsHead: a step leaves its
 * result in the other one, which counts once it is known to be sound. Behind both, of mounts two blocks of modal forces
 * that are held [size] and a MountPort per port: a look leaves its result in the one that its start does not name. */
typedef struct StateHead {
    uint64_t table_hash; /* mode table that the state belongs to */
    uint64_t cell;       /* whose modes q and v belong to */
    uint64_t place;      /* that counts, 0 or 1 */
} StateHead;

/* What a Forecast is of. */
typedef enum PortShown { SLIDE_SPEED, MOTOR_SPEED, MOTOR_WAY, PORTS_SHOWN } PortShown;

enum {
    GUIDE_DOUBLES = sizeof(GuideState) / sizeof(double),
    TRANSMISSION_DOUBLES = sizeof(TransmissionState) / sizeof(double),
    MOUNT_PORT_DOUBLES = sizeof(MountPort) / sizeof(double),
    MOUNTS_HEAD_DOUBLES = sizeof(MountsHead) / sizeof(double)
};

/* The first of the ports at the slides. */
static inline size_t plant_slides(const Plant *plant) {
    return plant->axes + TOOL_DIRECTIONS;
}

static inline size_t plant_ports(const Plant *plant) {
    return plant_slides(plant) + plant->axes;
}

static inline size_t plant_state_doubles(const Plant *plant) {
    const size_t mounts = plant->mounts.ports > 0 ? MOUNTS_HEAD_DOUBLES : 0;
    return plant_ports(plant) + 2 * plant->size + (3 + GUIDE_DOUBLES + TRANSMISSION_DOUBLES) * plant->axes + mounts;
}

/* Of a block of the mounts. */
static inline size_t plant_mounts_doubles(const Plant *plant) {
    return plant->mounts.ports > 0 ? plant->size + MOUNT_PORT_DOUBLES * plant->mounts.ports : 0;
}

static inline StateHead *plant_head(Unit *unit) {
    return unit_state(unit);
}

static inline double *plant_state_at(Unit *unit, const Plant *plant, uint64_t place) {
    return (double *)(plant_head(unit) + 1) + place * plant_state_doubles(plant);
}

static inline double *plant_state(Unit *unit) {
    return plant_state_at(unit, unit_derived(unit), plant_head(unit)->place);
}

/* Ways of the slides since the start, behind q and v of a state; what play takes off or adds follows. */
static inline double *plant_ways(const Plant *plant, double *state) {
    return state + plant_ports(plant) + 2 * plant->size;
}

static inline GuideState *plant_guides(const Plant *plant, double *state) {
    return (GuideState *)(void *)(plant_ways(plant, state) + 3 * plant->axes);
}

static inline TransmissionState *plant_transmissions(const Plant *plant, double *state) {
    return (TransmissionState *)(void *)(plant_guides(plant, state) + plant->axes);
}

static inline MountsHead *plant_mounts_head(const Plant *plant, double *state) {
    return (MountsHead *)(void *)(plant_transmissions(plant, state) + plant->axes);
}

/* Modal forces that the mounts are held at, in a block; their ports follow. */
static inline double *plant_mounts_held(Unit *unit, const Plant *plant, int block) {
    return plant_state_at(unit, plant, 2) + (block > 0 ? plant_mounts_doubles(plant) : 0);
}

static inline int plant_mounts_block(const Plant *plant, double *state) {
    return plant_mounts_head(plant, state)->block > 0;
}

/* --- load.c: the archive */
bool plant_load(Unit *unit);
void plant_release(Unit *unit);
/* Mode table of a text as values (see modes.h), to be freed with unit_free(); NULL with the fault logged. */
double *plant_table(Unit *unit, const Plant *plant, const char *text, size_t size, const char *source, size_t *modes);

/* --- derive.c: modal systems from the archive or from modes_file */
bool plant_derive(Unit *unit);
bool plant_accepts(Unit *unit, const Scalars *scalars, const void *state, size_t size);

/* --- outputs.c: what a state shows */
/* Speeds at the axes' rotors and displacements at their scales, y[ports]; false where one is no finite number. */
bool plant_measure(const Plant *plant, const Modal *modal, const double *q, const double *v, double *y);
/* Displacements at the tool, the rest of y[ports]; likewise. */
bool plant_measure_tool(const Plant *plant, const Modal *modal, const double *q, double *y);
/* Positions x[axes] from displacements at the axes' scales. */
void plant_positions(Unit *unit, const Plant *plant, const double *displacement, double *x);
/* Play of the drives, at the end of a step that leads from one place of the state to the other. */
void plant_play(Unit *unit, const Plant *plant, const double *before, double *ways);
/* Whether play and geometry are numbers at the ways that end a step: a cube of a way is soon none. */
bool plant_errors_are_numbers(const Plant *plant, const double *ways);
void plant_show(Unit *unit, const Plant *plant, const double *y);
void plant_show_play(Unit *unit, const Plant *plant, const double *ways);
void plant_show_tool(Unit *unit, Plant *plant, double *y);
/* Speed of an axis's slide: that of the structure there, unless play lets it stand. */
double plant_slide_speed(Unit *unit, const Plant *plant, const Modal *modal, size_t axis);
double plant_tool_speed(Unit *unit, const Plant *plant, const Modal *modal, size_t direction);

/* --- joints.c: friction at the guides, and transmissions */
/* Their initial state; what the motors' ports of the state get is then the structure's. */
void plant_start_joints(Unit *unit, Plant *plant, double *state);
/* Into how many equal steps one of h is cut, so that each is short enough for the fastest contact; of the parameters
 * and h alone. False with the reason logged where they are too many. */
bool plant_substeps(Unit *unit, const Plant *plant, double h, size_t *count);
/* Ahead of each of them: what they do over it, into `end` and among u and du. *acting: how many of shapes, u_acting and
 * du_acting there are. False with the reason logged. */
bool plant_join(Unit *unit, Plant *plant, const Modal *modal, double *state, double *end, double h, size_t *acting);
/* Behind it, with y measured: the structure as the modes of its cell have it. */
void plant_follow_joints(Unit *unit, const Plant *plant, const Modal *modal, double *end);
void plant_show_guides(Unit *unit, const Plant *plant, double *state);
void plant_show_transmissions(Unit *unit, const Plant *plant, double *state);

/* --- mounts.c: levelling mounts that are not linear */
/* The archive's table of them, after its modes; false with the fault logged. */
bool plant_read_mounts(Unit *unit, Plant *plant, const char *text, size_t size, const char *source);
void plant_free_mounts(Unit *unit, Plant *plant);
bool plant_derive_mounts(Unit *unit, Plant *plant);
/* Ahead of a step of h: how often they are looked at. False with the reason logged where no pace is stable. */
bool plant_pace_mounts(Unit *unit, Plant *plant, double h);
/* Behind it, with q in `end`: them, where it is time to look at them. False where a force is no finite number. */
bool plant_follow_mounts(Unit *unit, Plant *plant, double *state, double *end, double h);
void plant_show_mounts(Unit *unit, const Plant *plant, double *state);

#endif
