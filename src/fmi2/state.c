#include "state.h"

#include <ctype.h>
#include <math.h>
#include <string.h>

#include "log.h"
#include "numbers.h"
#include "values.h"

#define MAGIC "FEEDSIM"
#define FORMAT 1u
#define BYTE_ORDER_PROBE 0x01020304u

static unsigned char *content(const Snapshot *snapshot) {
    return (unsigned char *)(uintptr_t)(snapshot + 1);
}

static uint64_t checksum(const Snapshot *snapshot) {
    return hash_bytes(HASH_OF_NOTHING, content(snapshot), (size_t)(snapshot->fixed_size + snapshot->state_size));
}

/* Make room for `size` bytes in *snapshot. */
static bool allot(Unit *unit, Snapshot **snapshot, size_t size) {
    if (*snapshot != NULL && (*snapshot)->size == size) {
        return true;
    }
    Snapshot *fresh = unit_alloc(unit, size, 1);
    if (fresh == NULL) {
        return false;
    }
    unit_free(unit, *snapshot);
    *snapshot = fresh;
    return true;
}

bool state_save(Unit *unit, Snapshot **snapshot) {
    if (*snapshot != NULL && !state_known(unit, *snapshot)) {
        return false;
    }
    /* Before initial values exist, or while they are out of date, the model state means nothing. */
    const Header *header = unit_header(unit);
    size_t state_size = header->stale ? 0 : unit->block_size - unit->state_at;
    if (!run_show_late(unit)) { /* a saved state is complete */
        return false;
    }
    size_t size = sizeof(Snapshot) + unit->state_at + state_size;
    if (!allot(unit, snapshot, size)) {
        return false;
    }
    Snapshot *saved = *snapshot;
    memset(saved, 0, sizeof *saved);
    memcpy(saved->magic, MAGIC, sizeof MAGIC);
    saved->format = FORMAT;
    saved->byte_order = BYTE_ORDER_PROBE;
    memcpy(saved->guid, unit->guid, sizeof unit->guid);
    saved->size = size;
    saved->fixed_size = unit->state_at;
    saved->state_size = state_size;
    memcpy(content(saved), unit->block, unit->state_at + state_size);
    return true;
}

bool state_known(Unit *unit, const Snapshot *snapshot) {
    if (memcmp(snapshot->magic, MAGIC, sizeof MAGIC) != 0) {
        char shown[sizeof snapshot->magic + 1] = "";
        for (size_t i = 0; i < sizeof snapshot->magic; i++) {
            shown[i] = isprint((unsigned char)snapshot->magic[i]) ? snapshot->magic[i] : '.';
        }
        return unit_fail(unit, "not a saved state: it begins with '%s', expected is '%s'", shown, MAGIC);
    }
    if (snapshot->byte_order != BYTE_ORDER_PROBE) {
        return unit_fail(unit,
                         "the state was saved on a machine with another byte order: mark %08lx, expected is %08lx",
                         (unsigned long)snapshot->byte_order, (unsigned long)BYTE_ORDER_PROBE);
    }
    if (snapshot->format != FORMAT) {
        return unit_fail(unit, "the state has format version %lu, expected is %lu", (unsigned long)snapshot->format,
                         (unsigned long)FORMAT);
    }
    for (size_t i = sizeof unit->guid; i < sizeof snapshot->guid; i++) {
        if (snapshot->guid[i] != '\0') {
            return unit_fail(unit, "the state is damaged: byte %.0f behind its GUID is not 0",
                             (double)(i - sizeof unit->guid));
        }
    }
    if (memcmp(snapshot->guid, unit->guid, sizeof unit->guid) != 0) {
        return unit_fail(unit, "the state belongs to GUID '%.*s', this instance has '%s'", (int)sizeof snapshot->guid,
                         snapshot->guid, unit->guid);
    }
    if (snapshot->fixed_size != unit->state_at) {
        return unit_fail(unit, "the state holds %.0f bytes of variables, this instance has %.0f",
                         (double)snapshot->fixed_size, (double)unit->state_at);
    }
    return true;
}

/* The model's part of the state, into a block that was sized for the snapshot's parameters. */
static bool restore_model(Unit *unit, const Snapshot *snapshot) {
    const size_t state_size = unit->block_size - unit->state_at;
    if (snapshot->state_size != state_size) {
        return unit_fail(unit, "the state holds %.0f bytes of model state, its parameters need %.0f",
                         (double)snapshot->state_size, (double)state_size);
    }
    memcpy(unit_state(unit), content(snapshot) + unit->state_at, state_size);
    return true;
}

static bool accepted(Unit *unit, const Snapshot *snapshot) {
    const void *scalars = content(snapshot) + SCALARS_AT;
    return MODEL.accepts == NULL ||
           MODEL.accepts(unit, scalars, content(snapshot) + unit->state_at, (size_t)snapshot->state_size);
}

/* With coefficients of other parameters. Where they cannot be had, or are not those of the state, the block of before
 * is put back and its coefficients are derived again. */
static bool restore_with_parameters(Unit *unit, const Snapshot *snapshot) {
    const bool had_coefficients = unit->derived_valid;
    const size_t own_size = unit->block_size;
    unsigned char *own = unit_alloc(unit, own_size, 1);
    if (own == NULL) {
        return false;
    }
    memcpy(own, unit->block, own_size);
    memcpy(unit->block, content(snapshot), unit->state_at);
    unit->parameters_touched = true;
    bool good = run_derive(unit, true) && accepted(unit, snapshot) && restore_model(unit, snapshot);
    if (good) {
        unit_free(unit, own);
        unit->late = unit->tame = false;
        return true;
    }
    unit_free(unit, unit->block);
    unit->block = own;
    unit->block_size = own_size;
    unit->derived_valid = false;
    if (!unit_header(unit)->stale && !run_derive(unit, false) && had_coefficients) {
        unit_header(unit)->phase = PHASE_FAILED; /* say, the file they came from is gone by now */
    }
    return false;
}

bool state_restore(Unit *unit, const Snapshot *snapshot) {
    if (!state_known(unit, snapshot)) {
        return false;
    }
    Header header;
    memcpy(&header, content(snapshot), sizeof header);
    if (!header.stale) {
        if (!accepted(unit, snapshot)) {
            return false;
        }
        if (!run_derived_for(unit, content(snapshot))) {
            return restore_with_parameters(unit, snapshot);
        }
        if (!restore_model(unit, snapshot)) {
            return false;
        }
    }
    memcpy(unit->block, content(snapshot), unit->state_at);
    unit->parameters_touched = true;
    unit->late = unit->tame = false;
    return true;
}

bool state_serialize(Unit *unit, const Snapshot *snapshot, fmi2Byte bytes[], size_t size) {
    if (!state_known(unit, snapshot)) {
        return false;
    }
    if (size < snapshot->size) {
        return unit_fail(unit, "the array has %.0f bytes, the state needs %.0f", (double)size, (double)snapshot->size);
    }
    Snapshot heading = *snapshot;
    heading.checksum = checksum(snapshot);
    memcpy(bytes, &heading, sizeof heading);
    memcpy(bytes + sizeof heading, content(snapshot), (size_t)snapshot->size - sizeof heading);
    return true;
}

/* --- what came from outside: the checksum finds damage, these what was never saved by a unit */

static bool header_sound(Unit *unit, const Header *header) {
    char text[2][NUMBER_TEXT_SIZE];
    if (header->phase >= PHASE_COUNT) {
        return unit_fail(unit, "the serialized state is damaged: it is in phase %lu of %d",
                         (unsigned long)header->phase, PHASE_COUNT);
    }
    if (header->stale && header->phase > PHASE_INITIALIZATION) {
        return unit_fail(unit, "the serialized state is damaged: initialised (phase %lu), but without initial values",
                         (unsigned long)header->phase);
    }
    if (header->last_step != fmi2OK && header->last_step != fmi2Error) {
        return unit_fail(unit, "the serialized state is damaged: no step ends with status %lu",
                         (unsigned long)header->last_step);
    }
    if (!isfinite(header->start_time) || !isfinite(header->time) || isnan(header->stop_time)) {
        return unit_fail(unit, "the serialized state is damaged: started at %s s, it stands at %s s%s",
                         number_text(text[0], header->start_time), number_text(text[1], header->time),
                         isnan(header->stop_time) ? " and stops at nan s" : "");
    }
    const bool begun = header->phase > PHASE_INITIALIZATION;
    if (!begun && (header->time < header->start_time || header->time > header->start_time)) {
        return unit_fail(unit,
                         "the serialized state is damaged: not initialised yet, to start at %s s, it stands at %s s",
                         number_text(text[0], header->start_time), number_text(text[1], header->time));
    }
    return true;
}

static bool slopes_sound(Unit *unit, const Header *header, const unsigned char *block) {
    for (size_t i = 0; i < unit->input_count; i++) {
        double slope;
        memcpy(&slope, block + unit->slopes_at + unit->inputs[i] * sizeof slope, sizeof slope);
        const bool none = !(slope < 0 || slope > 0);
        if (!isfinite(slope) || !(none || header->sloped)) {
            char name[VARIABLE_NAME_SIZE], text[NUMBER_TEXT_SIZE];
            return unit_fail(unit, "the slope of input '%s' is %s; allowed is a finite one, and 0 where none was set",
                             table_name(unit, &unit->variables[unit->inputs[i]], name), number_text(text, slope));
        }
    }
    return true;
}

static bool block_sound(Unit *unit, const unsigned char *block) {
    Header header;
    memcpy(&header, block, sizeof header);
    /* Results may be anything where a step has failed, or the making of initial values. */
    const bool results = header.phase != PHASE_FAILED && !header.stale;
    return header_sound(unit, &header) && values_sound(unit, block, results) && slopes_sound(unit, &header, block);
}

bool state_deserialize(Unit *unit, const fmi2Byte bytes[], size_t size, Snapshot **snapshot) {
    if (*snapshot != NULL && !state_known(unit, *snapshot)) {
        return false;
    }
    Snapshot heading;
    if (size < sizeof heading) {
        return unit_fail(unit, "the serialized state has %.0f bytes, its heading alone has %.0f", (double)size,
                         (double)sizeof heading);
    }
    memcpy(&heading, bytes, sizeof heading);
    if (!state_known(unit, &heading)) {
        return false;
    }
    if (heading.size > size || heading.size < sizeof heading + unit->state_at ||
        heading.size - sizeof heading - unit->state_at != heading.state_size) {
        return unit_fail(unit, "the serialized state has %.0f bytes, its heading speaks of %.0f", (double)size,
                         (double)heading.size);
    }
    uint64_t checksum = hash_bytes(HASH_OF_NOTHING, bytes + sizeof heading, (size_t)heading.size - sizeof heading);
    if (checksum != heading.checksum) {
        char text[2][HASH_TEXT_SIZE];
        return unit_fail(unit, "the serialized state is damaged: checksum %s, its heading says %s",
                         hash_text(text[0], checksum), hash_text(text[1], heading.checksum));
    }
    if (!block_sound(unit, (const unsigned char *)bytes + sizeof heading)) {
        return false;
    }
    if (!allot(unit, snapshot, (size_t)heading.size)) {
        return false;
    }
    memcpy(*snapshot, bytes, (size_t)heading.size);
    return true;
}
