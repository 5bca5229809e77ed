/* A part of the machine: another unit's model functions, linked once more.
 *
 * A model knows the shell by unit.h alone. part_shell.h is a second implementation of that header, compiled into a part
 * together with the model (plant_part.c ...): variables and state of the part lie in the block of the machine, which
 * saves, restores and checks them as its own; memory, messages and axes go to the machine's shell. */
#ifndef FEEDSIM_PART_H
#define FEEDSIM_PART_H

#include <stdbool.h>
#include <stddef.h>

typedef struct Part Part;

/* What a part asks of the machine; `host` is the machine's unit. */
typedef struct PartHost {
    void *(*alloc)(void *host, size_t count, size_t size);
    void (*release)(void *host, void *memory);
    void (*fail)(void *host, const char *label, const char *text);
    void (*warn)(void *host, const char *label, const char *text);
    bool (*set_axes)(void *host, Part *part, size_t count, const char *const *names);
    const char *(*axis_name)(void *host, const Part *part, size_t axis);
} PartHost;

struct Part {
    const PartHost *calls;
    void *host;
    const char *label;         /* ahead of its messages, as the names of its variables begin */
    const char *location;      /* of the resources, as the importer gave it */
    const char *resources;     /* directory */
    const char *resource_hash; /* of its own resource files */
    void *derived;
    size_t axes;
    /* Anew before each use, since the machine's block may move. */
    unsigned char *scalars;    /* where its Scalars lie */
    unsigned char *axis_block; /* where the AxisBlock of its first axis lies, those of others */
    size_t axis_stride;        /* so many bytes apart, */
    const size_t *axis_of;     /* in the order of the machine's axes; NULL: in its own */
    void *state;
    double *slopes; /* by its value references; all 0 unless `sloped` */
    double start_time;
    bool sloped;
    /* Of the saved state that it is asked to accept; see Clock in unit.h. */
    struct {
        double start, time;
        bool valid;
    } clock;
};

/* A model's functions on its part; as in unit.h. `scalars` of accepts(): where they lie in a foreign block. */
typedef struct PartModel {
    bool (*load)(Part *part); /* NULL where there is nothing to load */
    bool (*derive)(Part *part);
    size_t (*state_size)(const Part *part);
    bool (*accepts)(Part *part, const void *scalars, const void *state, size_t size);
    void (*start)(Part *part);
    bool (*step)(Part *part, double t, double h);
    void (*show_late)(Part *part);
    double (*output_derivative)(Part *part, unsigned vr);
    void (*release)(Part *part);
    /* Where its rows lie in its Scalars and AxisBlock, by which the machine's table is held against them. */
    const size_t *scalar_places, *axis_places;
    size_t scalar_rows, axis_rows;
} PartModel;

#define plant_part machine_plant_part
#define controller_part machine_controller_part
#define friction_part machine_friction_part
#define setpoint_part machine_setpoint_part
extern const PartModel plant_part, controller_part, friction_part, setpoint_part;

#endif
