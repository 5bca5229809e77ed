/* Saved states: a copy of the block behind a heading that says what it belongs to. The form in memory and the
 * serialised form are the same bytes, free of pointers. */
#ifndef FEEDSIM_STATE_H
#define FEEDSIM_STATE_H

#include <stdint.h>

#include "fmi2Functions.h"
#include "shell.h"

typedef struct Snapshot {
    char magic[8];
    uint32_t format;
    uint32_t byte_order;
    char guid[40];
    uint64_t size;       /* of the whole, this heading included */
    uint64_t fixed_size; /* of header, variables and slopes */
    uint64_t state_size; /* of the model state; 0 where there was none that counts */
    uint64_t checksum;   /* of what follows the heading; serialised form only */
} Snapshot;

/* All return false with the reason logged where they fail. */
bool state_save(Unit *unit, Snapshot **snapshot); /* overwrites *snapshot where it is not NULL and large enough */
bool state_restore(Unit *unit, const Snapshot *snapshot); /* a state that is refused leaves the instance's own */
bool state_known(Unit *unit, const Snapshot *snapshot);   /* made by state_save or state_deserialize, for this unit */
bool state_serialize(Unit *unit, const Snapshot *snapshot, fmi2Byte bytes[], size_t size);
bool state_deserialize(Unit *unit, const fmi2Byte bytes[], size_t size, Snapshot **snapshot);

#endif
