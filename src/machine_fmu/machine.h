/* What the rooms of the machine share: its parts, what is derived of the parameters, and the layout of the state. */
#ifndef FEEDSIM_MACHINE_H
#define FEEDSIM_MACHINE_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "cycle.h"
#include "hash.h"
#include "instants.h"
#include "part.h"
#include "unit.h"

/* A row of the schemes (cycle.h), as far as a cycle needs it. */
typedef enum Speed { SPEED_within, SPEED_end, SPEED_start, SPEED_extrapolated } Speed;
typedef struct Scheme {
    Speed speed;
    bool torque_ramp, friction_ramp;
    int passes;
    bool friction_first;
} Scheme;
extern const Scheme machine_schemes[LAST_SCHEME + 1];

/* Derived data. */
typedef struct Machine {
    size_t axes;
    bool warned;             /* of held setpoints */
    bool warned_far[2];      /* of setpoints that begin elsewhere than the axes stand: at a later release, at first */
    bool has_motion;         /* the archive holds one */
    Part plant, motion;      /* motion: has_motion alone */
    Part *drives, *contacts; /* [axes] */
    char *labels;            /* of those, LABEL_SIZE each */
    double *slopes;          /* memory of the parts' slopes */
    size_t *motion_axes;     /* axis of each axis of the motion */
    char plant_hash[HASH_TEXT_SIZE], motion_hash[HASH_TEXT_SIZE];
    const unsigned char *bound; /* the state that the parts point into; NULL: into none */

    /* Of the parameters: */
    bool ready;
    double T_c;
    const Scheme *scheme;
    size_t substeps;
    size_t *places;   /* [2 + 2 axes] where the state of a part begins: plant, contacts, drives; the end */
    double *vectors;  /* scratch of an exchange step, machine_scratch() */
    size_t kept_size; /* bytes that an exchange step that is taken again goes back to */
    unsigned char *kept;
} Machine;

enum { LABEL_SIZE = 48, VECTORS = 7 };

/* Samples of setpoints that are kept, the newest first. They lie a position cycle apart, or an eighth of the delay,
 * whichever is longer; so they reach back over the delay and two more. */
enum { SAMPLES = 12, SAMPLES_IN_DELAY = 8 };

/* State block: this head, an AxisState per axis, the parts' states as `places` says. */
typedef struct StateHead {
    int64_t cycle;            /* control cycles worked */
    uint64_t end;             /* places[2 axes + 1]: which layout the state has */
    double share;             /* of the last cycle, that lies behind the communication point, machine_share() [1] */
    double tool[3];           /* at the start of the last cycle, where share is not 1: tool.x [m] */
    double tool_v[3];         /* and its speed [m/s] */
    int64_t sampled;          /* whether there are samples of setpoints */
    double sample_t[SAMPLES]; /* [s] */
} StateHead;

/* What an axis had at the ends of the last control cycle. Position and speed at its end: drive.x_a, drive.n_a. */
typedef struct AxisState {
    double M_fr, M_fr_slope;         /* at its end, and over its last exchange step */
    double n_slope;                  /* of the last exchange step, as the extrapolating schemes need it */
    double M_a, M_a_slope, i_d, i_q; /* at its end; over it */
    double x_a, x_a_v, n_a, M_fr_0;  /* at its start, where share is not 1 */
    double M_a_before;               /* at its start, as those schemes know it that hold it */
    double x_s[SAMPLES], n_ffw[SAMPLES];
} AxisState;

static inline StateHead *machine_head(Unit *unit) {
    return unit_state(unit);
}

static inline AxisState *machine_axis_states(Unit *unit) {
    return (AxisState *)(machine_head(unit) + 1);
}

/* First rows of the parts in the machine's table; rows.c holds the rest against the parts'. */
enum {
    MOTION_FIRST = VR_motion_finished,
    PLANT_FIRST = VR_plant_modes_file,
    PLANT_AXIS_FIRST = AXIS_VR_plant_M_a,
    DRIVE_FIRST = AXIS_VR_drive_x_s,
    FRICTION_FIRST = AXIS_VR_friction_n_fr,
    MOTION_AXIS_FIRST = AXIS_VR_motion_x_s
};

/* --- rows.c: whether the parts' rows lie in the machine's table as in the parts themselves; false with the reason
 * logged */
bool machine_rows_agree(Unit *unit);

/* --- load.c: the archive */
bool machine_load(Unit *unit);
void machine_release(Unit *unit);

/* Share [1] of the last cycle that lies behind the communication point, which is `ahead` [s] of the cycle's end. Above
 * 1 where the point lies behind that end, and yet the next cycle belongs to the next step (instants_margin()): up to a
 * hundredth of a cycle. What is shown there runs on as in the last cycle. */
static inline double machine_share(double ahead, double T_c) {
    const double share = 1 - ahead / T_c;
    return fabs(ahead) < INSTANTS_ROUNDING * T_c ? 1 : fmin(fmax(share, 0), 1 + INSTANTS_DRIFT);
}

/* --- derive.c */
bool machine_derive(Unit *unit);
bool machine_accepts(Unit *unit, const Scalars *scalars, const void *state, size_t size);
/* Point the parts at where their variables and, behind derive(), their states lie now. */
void machine_bind(Unit *unit, bool with_states);

/* --- path.c: setpoints from outside, between their samples */
/* Whether the samples are needed, at all. */
bool machine_path_used(const Scalars *scalars);
/* Keep the setpoints that hold at the start of a step of h from t on; false where the step is too long for the delay.
 */
bool machine_path_take(Unit *unit, double t, double h);
/* What the drive of an axis reads at t_k in a step that began at t. */
void machine_path_tell(Unit *unit, size_t axis, double t, double t_k);

/* --- exchange.c: one control cycle from t_k on, in a step that began at t [s] */
bool machine_cycle(Unit *unit, double t, double t_k);
/* Doubles of scratch that it needs. */
size_t machine_scratch(size_t axes);

#endif
