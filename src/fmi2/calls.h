/* Which function may be called when (FMI 2.0, 4.2.4: call sequence of co-simulation slaves). */
#ifndef FEEDSIM_CALLS_H
#define FEEDSIM_CALLS_H

#include <stdbool.h>

#include "prefix.h"
#include "unit.h"

/* The standard's states, less those an FMU without asynchronous steps and without fmi2Discard never enters. */
typedef enum Phase {
    PHASE_INSTANTIATED,
    PHASE_INITIALIZATION,
    PHASE_STEPPING, /* "step complete" */
    PHASE_TERMINATED,
    PHASE_FAILED, /* "error" */
    PHASE_COUNT
} Phase;

#define IN_INSTANTIATED (1u << PHASE_INSTANTIATED)
#define IN_INITIALIZATION (1u << PHASE_INITIALIZATION)
#define IN_STEPPING (1u << PHASE_STEPPING)
#define IN_TERMINATED (1u << PHASE_TERMINATED)
#define IN_FAILED (1u << PHASE_FAILED)

#define IN_ANY (IN_INSTANTIATED | IN_INITIALIZATION | IN_STEPPING | IN_TERMINATED | IN_FAILED)
#define IN_SETTING (IN_INSTANTIATED | IN_INITIALIZATION | IN_STEPPING)
#define IN_GETTING (IN_INITIALIZATION | IN_STEPPING | IN_TERMINATED | IN_FAILED)
#define IN_STEPPED (IN_STEPPING | IN_TERMINATED | IN_FAILED)

#define CALLS(CALL)                                                                                                    \
    CALL(Instantiate, 0)                                                                                               \
    CALL(FreeInstance, IN_ANY)                                                                                         \
    CALL(SetDebugLogging, IN_ANY)                                                                                      \
    CALL(SetupExperiment, IN_INSTANTIATED)                                                                             \
    CALL(EnterInitializationMode, IN_INSTANTIATED)                                                                     \
    CALL(ExitInitializationMode, IN_INITIALIZATION)                                                                    \
    CALL(Terminate, IN_STEPPING)                                                                                       \
    CALL(Reset, IN_ANY)                                                                                                \
    CALL(GetReal, IN_GETTING)                                                                                          \
    CALL(GetInteger, IN_GETTING)                                                                                       \
    CALL(GetBoolean, IN_GETTING)                                                                                       \
    CALL(GetString, IN_GETTING)                                                                                        \
    CALL(SetReal, IN_SETTING)                                                                                          \
    CALL(SetInteger, IN_SETTING)                                                                                       \
    CALL(SetBoolean, IN_SETTING)                                                                                       \
    CALL(SetString, IN_SETTING)                                                                                        \
    CALL(GetFMUstate, IN_ANY)                                                                                          \
    CALL(SetFMUstate, IN_ANY)                                                                                          \
    CALL(FreeFMUstate, IN_ANY)                                                                                         \
    CALL(SerializedFMUstateSize, IN_ANY)                                                                               \
    CALL(SerializeFMUstate, IN_ANY)                                                                                    \
    CALL(DeSerializeFMUstate, IN_ANY)                                                                                  \
    CALL(GetDirectionalDerivative, IN_GETTING)                                                                         \
    CALL(SetRealInputDerivatives, IN_SETTING)                                                                          \
    CALL(GetRealOutputDerivatives, IN_STEPPED)                                                                         \
    CALL(DoStep, IN_STEPPING)                                                                                          \
    CALL(CancelStep, 0)                                                                                                \
    CALL(GetStatus, IN_STEPPED)                                                                                        \
    CALL(GetRealStatus, IN_STEPPED)                                                                                    \
    CALL(GetIntegerStatus, IN_STEPPED)                                                                                 \
    CALL(GetBooleanStatus, IN_STEPPED)                                                                                 \
    CALL(GetStringStatus, IN_STEPPED)

#define CALL_NAME(name, phases) CALL_##name,
typedef enum Call { CALLS(CALL_NAME) CALL_COUNT } Call;
#undef CALL_NAME

/* PHASES_DoStep: the states in which fmi2DoStep may be called */
#define CALL_PHASES(name, phases) PHASES_##name = phases,
enum { CALLS(CALL_PHASES) };
#undef CALL_PHASES

/* "fmi2DoStep" */
#define CALL_TEXT(name, phases) "fmi2" #name,
static inline const char *call_name(Call call) {
    static const char *const names[] = {CALLS(CALL_TEXT)};
    return names[call];
}
#undef CALL_TEXT

/* Note that `call` begins, for messages, and check that it is allowed in the state the instance is in; false with an
 * error logged where it is not, or where there is no instance. */
bool call_begin(Unit *unit, Call call);

/* The same note with the call's arguments (printf-style), for the log of calls. */
void call_tell(Unit *unit, Call call, const char *format, ...)
#ifdef __GNUC__
    __attribute__((format(printf, 3, 4)))
#endif
    ;

#endif
