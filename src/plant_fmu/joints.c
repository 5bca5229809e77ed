/* Forces that the structure's own motion makes: friction at the guides, and transmissions between motors and structure.
 *
 * They follow from speeds and ways at the end of a step and act within it. The step is a linear map, so that what the
 * ports show at its end is known ahead, but for these forces (modal_forecast()). They are settled with one another
 * there, in a few numbers, and then the modes are advanced once, with all forces known. */
#include <math.h>

#include "numbers.h"
#include "plant.h"

enum { JOINT_PASSES = 20, JOINT_SUBSTEPS = 1000 };
static const double JOINT_ANGLE = 0.3; /* of a contact's wave in a substep, at most [rad] */
static const double two_pi = 6.28318530717958647693;

static Forecast *plant_forecast(const Plant *plant, PortShown shown, size_t axis) {
    return &plant->forecasts[shown * plant->axes + axis];
}

/* How what the ports show at the end of a step of h depends on its start and on forces. */
static void plant_prepare_joints(Plant *plant, const Modal *modal, double h) {
    if (plant->foretold == modal && plant->foretold_h == h) {
        return;
    }
    const size_t axes = plant->axes, slides = plant_slides(plant);
    for (size_t i = 0; i < axes; i++) {
        if (plant->guides[i].on) {
            modal_forecast(modal, slides + i, true, plant_forecast(plant, SLIDE_SPEED, i));
        }
        if (plant->transmissions[i].on) {
            modal_forecast(modal, i, true, plant_forecast(plant, MOTOR_SPEED, i));
            Forecast *way = plant_forecast(plant, MOTOR_WAY, i);
            modal_forecast(modal, i, false, way);
            for (size_t k = 0; k < modal->size; k++) { /* from the start: of a slide far out no digit is lost */
                way->q[k] -= modal->shape[i * modal->size + k];
            }
        }
        for (size_t j = 0; j < axes; j++) {
            plant->held[i * axes + j] = plant_forecast(plant, SLIDE_SPEED, i)->held[slides + j];
            plant->ramp[i * axes + j] = plant_forecast(plant, SLIDE_SPEED, i)->ramp[slides + j];
            plant->by_n[i * axes + j] = plant_forecast(plant, MOTOR_SPEED, i)->held[j];
            plant->by_way[i * axes + j] = plant_forecast(plant, MOTOR_WAY, i)->held[j];
            plant->by_n_ramp[i * axes + j] =
                plant_forecast(plant, MOTOR_SPEED, i)->ramp[j] - plant->by_n[i * axes + j] / 2;
            plant->by_way_ramp[i * axes + j] =
                plant_forecast(plant, MOTOR_WAY, i)->ramp[j] - plant->by_way[i * axes + j] / 2;
        }
    }
    plant->foretold = modal;
    plant->foretold_h = h;
}

/* What a port shows at the end of the step with the forces from outside alone. */
static double plant_without_joints(Unit *unit, const Plant *plant, const Forecast *forecast, size_t acting,
                                   double *state) {
    const double *q = state + plant_ports(plant);
    double sum = modal_foretold(forecast, plant->size, q, q + plant->size);
    if (plant->mounts.on) {
        const Modal by_force = {.size = plant->size, .shape = forecast->f};
        sum += modal_sum(&by_force, 0, plant_mounts_held(unit, plant, plant_mounts_block(plant, state)));
    }
    for (size_t i = 0; i < acting; i++) {
        const size_t port = plant->acting[i];
        sum += forecast->held[port] * plant->u[port] + forecast->ramp[port] * plant->du[port];
    }
    return sum;
}

/* The torques at motors with a transmission, taken off the structure, which keeps the constant load: a weight hangs
 * behind the play. */
static void plant_take_motors(Unit *unit, Plant *plant) {
    for (size_t i = 0; i < plant->axes; i++) {
        if (plant->transmissions[i].on) {
            const double M_0 = unit_axis(unit, i)->M_0;
            plant->motor_u[i] = plant->u[i] + M_0;
            plant->motor_du[i] = plant->du[i];
            plant->u[i] = -M_0;
            plant->du[i] = 0;
        }
    }
}

/* What friction at the guides adds to what a motor's port shows. */
static double plant_by_guides(const Plant *plant, const Forecast *forecast, const GuideState *start,
                              const GuideState *end) {
    const size_t slides = plant_slides(plant);
    double sum = 0;
    for (size_t i = 0; i < plant->axes; i++) {
        sum -= forecast->held[slides + i] * start[i].F + forecast->ramp[slides + i] * (end[i].F - start[i].F);
    }
    return sum;
}

static bool plant_settle_guides(const Plant *plant, const double *v_free, double *state, double *end, double h,
                                bool *settled) {
    return guide_step(plant->axes, plant->guides, v_free, plant->held, plant->ramp, plant_guides(plant, state),
                      plant_guides(plant, end), h, settled);
}

/* Transmissions, and guides with them: the torques of the motors change the friction and are changed by it, by turns,
 * until they have settled. */
static bool plant_settle_transmissions(Plant *plant, double *state, double *end, double h, bool *settled) {
    const double enough = 1e-8, unsettled = 1e-6; /* of the largest torque */
    const size_t axes = plant->axes;
    const TransmissionState *start = plant_transmissions(plant, state);
    TransmissionState *motors = plant_transmissions(plant, end);
    const GuideState *guides_start = plant_guides(plant, state);
    GuideState *guides = plant_guides(plant, end);
    double largest = 0, change = INFINITY;
    bool guides_settled = true;
    TransmissionPorts ports = {.way_free = plant->way_free,
                               .n_free = plant->n_free,
                               .by_way = plant->by_way,
                               .by_n = plant->by_n,
                               .by_way_ramp = plant->by_way_ramp,
                               .by_n_ramp = plant->by_n_ramp};
    if (!plant->guided) {
        return transmission_step(axes, plant->transmissions, plant->motor_u, plant->motor_du, &ports, start, motors, h,
                                 settled);
    }
    ports.way_free = plant->way;
    ports.n_free = plant->n;
    for (size_t i = 0; i < axes; i++) {
        guides[i].F = guides_start[i].F + guides_start[i].slope * h; /* a first guess */
    }
    for (int pass = 0; pass < JOINT_PASSES; pass++) {
        for (size_t i = 0; i < axes; i++) {
            const Forecast *way = plant_forecast(plant, MOTOR_WAY, i), *n = plant_forecast(plant, MOTOR_SPEED, i);
            plant->way[i] = plant->way_free[i] + plant_by_guides(plant, way, guides_start, guides);
            plant->n[i] = plant->n_free[i] + plant_by_guides(plant, n, guides_start, guides);
            plant->y[i] = motors[i].T;
        }
        if (!transmission_step(axes, plant->transmissions, plant->motor_u, plant->motor_du, &ports, start, motors, h,
                               settled)) {
            return false;
        }
        largest = change = 0;
        for (size_t i = 0; i < axes; i++) {
            largest = fmax(largest, fabs(motors[i].T));
            change = fmax(change, fabs(motors[i].T - plant->y[i]));
        }
        if (pass > 0 && !(change > enough * largest)) {
            break;
        }
        for (size_t i = 0; i < axes; i++) {
            plant->v[i] = plant->v_free[i];
            for (size_t j = 0; j < axes; j++) {
                const Forecast *v = plant_forecast(plant, SLIDE_SPEED, i);
                plant->v[i] += v->held[j] * (motors[j].T - motors[j].ramp / 2) + v->ramp[j] * motors[j].ramp;
            }
        }
        if (!plant_settle_guides(plant, plant->v, state, end, h, &guides_settled)) {
            return false;
        }
    }
    *settled = *settled && guides_settled && !(change > unsettled * largest);
    return true;
}

bool plant_substeps(Unit *unit, const Plant *plant, double h, size_t *count) {
    const Transmission *fastest = plant->transmissions;
    for (size_t i = 1; i < plant->axes; i++) {
        fastest = plant->transmissions[i].rate > fastest->rate ? &plant->transmissions[i] : fastest;
    }
    /* a step that ends exactly there needs no further one */
    const double needed = ceil(fastest->rate * h / JOINT_ANGLE * (1 - 1e-9));
    *count = needed > 1 ? (size_t)fmin(needed, JOINT_SUBSTEPS) : 1;
    if (needed <= JOINT_SUBSTEPS) {
        return true;
    }
    const size_t axis = (size_t)(fastest - plant->transmissions);
    const AxisBlock *v = unit_axis(unit, axis);
    char text[5][NUMBER_TEXT_SIZE];
    return unit_fail(unit,
                     "the contact '%s.transmission' is too fast for a step of %s s: with a stiffness of %s N/m and a "
                     "damping of %s N.s/m it answers at %s Hz, and needs substeps of %s s; allowed are %.0f in a step: "
                     "take a shorter step, or a softer contact",
                     unit_axis_name(unit, axis), number_text(text[0], h),
                     number_text(text[1], v->transmission_stiffness), number_text(text[2], v->transmission_damping),
                     number_text(text[3], fastest->rate / two_pi), number_text(text[4], JOINT_ANGLE / fastest->rate),
                     (double)JOINT_SUBSTEPS);
}

bool plant_join(Unit *unit, Plant *plant, const Modal *modal, double *state, double *end, double h, size_t *acting) {
    const size_t axes = plant->axes, slides = plant_slides(plant), ports = plant_ports(plant);
    const GuideState *start = plant_guides(plant, state);
    size_t count = 0;
    bool settled = true;
    plant_prepare_joints(plant, modal, h);
    if (plant->driven) {
        plant_take_motors(unit, plant);
    }
    for (size_t port = 0; port < ports; port++) {
        if (port < axes || plant->u[port] != 0 || plant->du[port] != 0) {
            plant->acting[count++] = port;
        }
    }
    for (size_t i = 0; i < axes; i++) {
        if (plant->guides[i].on) {
            plant->v_free[i] = plant_without_joints(unit, plant, plant_forecast(plant, SLIDE_SPEED, i), count, state);
        }
        if (plant->transmissions[i].on) {
            plant->n_free[i] = plant_without_joints(unit, plant, plant_forecast(plant, MOTOR_SPEED, i), count, state);
            plant->way_free[i] = plant_without_joints(unit, plant, plant_forecast(plant, MOTOR_WAY, i), count, state);
        }
    }
    if (!(plant->driven ? plant_settle_transmissions(plant, state, end, h, &settled)
                        : plant_settle_guides(plant, plant->v_free, state, end, h, &settled))) {
        return unit_fail(unit, plant->driven ? "a force behind a motor would be no finite number at the end of the step"
                                             : "a friction force at a guide would be no finite number at the end of "
                                               "the step");
    }
    if (!settled) {
        char text[NUMBER_TEXT_SIZE];
        return unit_fail(unit,
                         "the forces of guides and transmissions do not settle over this step of %s s: they differ by "
                         "more than 1e-4 of F_S, or 1e-6 of the largest torque, after all passes; take a shorter step, "
                         "and see that motors that move one mass share its inertia",
                         number_text(text, h));
    }
    for (size_t i = 0; i < axes; i++) {
        const size_t slide = slides + i;
        if (plant->transmissions[i].on) {
            const TransmissionState *motor = &plant_transmissions(plant, end)[i];
            plant->u[i] += motor->T - motor->ramp / 2;
            plant->du[i] += motor->ramp;
        }
        if (plant->guides[i].on) {
            if (!(plant->u[slide] != 0 || plant->du[slide] != 0)) {
                plant->acting[count++] = slide;
            }
            plant->u[slide] -= start[i].F;
            plant->du[slide] -= plant_guides(plant, end)[i].F - start[i].F;
        }
    }
    for (size_t i = 0; i < count; i++) {
        const size_t port = plant->acting[i];
        plant->shapes[i] = modal->shape + port * modal->size;
        plant->u_acting[i] = plant->u[port];
        plant->du_acting[i] = plant->du[port];
    }
    *acting = count;
    return true;
}

void plant_start_joints(Unit *unit, Plant *plant, double *state) {
    for (size_t i = 0; i < plant->axes; i++) {
        plant_guides(plant, state)[i].x = unit_axis(unit, i)->x_0;
        if (plant->transmissions[i].on) {
            const double M_0 = unit_axis(unit, i)->M_0;
            plant_transmissions(plant, state)[i].u = state[i] + M_0;
            state[i] = -M_0;
        }
    }
}

void plant_follow_joints(Unit *unit, const Plant *plant, const Modal *modal, double *end) {
    const size_t slides = plant_slides(plant);
    const double *v_end = end + plant_ports(plant) + plant->size;
    for (size_t i = 0; i < plant->axes; i++) {
        if (plant->guides[i].on) {
            GuideState *guide = &plant_guides(plant, end)[i];
            guide->x = unit_axis(unit, i)->x_0 + plant->y[slides + i];
            if (plant->cells > 1) {
                guide->v = modal_sum(modal, slides + i, v_end);
            }
        }
        if (plant->cells > 1 && plant->transmissions[i].on) { /* the motor turned along with the structure */
            plant_transmissions(plant, end)[i].n_s = modal_sum(modal, i, v_end);
        }
    }
}

void plant_show_guides(Unit *unit, const Plant *plant, double *state) {
    for (size_t i = 0; i < plant->axes; i++) {
        if (plant->guides[i].on) {
            const GuideState *guide = &plant_guides(plant, state)[i];
            AxisBlock *axis = unit_axis(unit, i);
            axis->guide_F_fr = guide->F;
            axis->guide_z = guide->contact.z;
            axis->guide_E_fr = guide->work;
            axis->guide_warmth = guide->warmth;
        }
    }
}

void plant_show_transmissions(Unit *unit, const Plant *plant, double *state) {
    for (size_t i = 0; i < plant->axes; i++) {
        if (plant->transmissions[i].on) {
            const TransmissionState *motor = &plant_transmissions(plant, state)[i];
            AxisBlock *axis = unit_axis(unit, i);
            axis->n_a = axis->n_fr = motor->n;
            axis->transmission_F = motor->C / plant->transmissions[i].lead;
            axis->transmission_way = motor->delta * plant->transmissions[i].lead;
            axis->transmission_heat = motor->heat;
        }
    }
}
