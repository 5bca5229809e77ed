#include "calls.h"

#include <stdarg.h>
#include <string.h>

#include "log.h"
#include "shell.h"

#define CALL_ROW(name, phases) phases,
static const unsigned phases_of[] = {CALLS(CALL_ROW)};
#undef CALL_ROW

static const char *const phase_names[] = {"'instantiated'", "'initialization mode'", "'step complete'", "'terminated'",
                                          "'error'"};

void call_tell(Unit *unit, Call call, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    unit->call = call;
    log_write_list(unit, LOG_CALLS, format, arguments);
    va_end(arguments);
}

bool call_begin(Unit *unit, Call call) {
    if (unit == NULL) {
        return false;
    }
    unit->call = call;
    Phase phase = (Phase)unit_header(unit)->phase;
    if (phases_of[call] & 1u << phase) {
        return true;
    }
    if (phases_of[call] == 0) {
        return unit_fail(unit, "not allowed in any state: steps are never asynchronous, so none can be in progress");
    }
    char allowed[128] = "";
    for (unsigned i = 0; i < PHASE_COUNT; i++) {
        if (phases_of[call] & 1u << i) {
            strcat(allowed, *allowed ? ", " : "");
            strcat(allowed, phase_names[i]);
        }
    }
    return unit_fail(unit, "not allowed in state %s; allowed in: %s%s", phase_names[phase], allowed,
                     phase == PHASE_FAILED ? " (after an error: fmi2SetFMUstate, fmi2Reset or fmi2FreeInstance)" : "");
}
