/* Messages to the importer, by category. */
#ifndef FEEDSIM_LOG_H
#define FEEDSIM_LOG_H

#include <stdarg.h>
#include <stdbool.h>

#include "fmi2Functions.h"
#include "prefix.h"
#include "unit.h"

enum { LOG_ERRORS = 1, LOG_WARNINGS = 2, LOG_EVENTS = 4, LOG_CALLS = 8, LOG_EVERYTHING = 15 };

/* One message, printf-style, where the importer wants its category; the name of the running function goes ahead of it.
 */
void log_write(Unit *unit, unsigned category, const char *format, ...)
#ifdef __GNUC__
    __attribute__((format(printf, 3, 4)))
#endif
    ;
void log_write_list(Unit *unit, unsigned category, const char *format, va_list arguments)
#ifdef __GNUC__
    __attribute__((format(printf, 3, 0)))
#endif
    ;

/* What fmi2SetDebugLogging asks for. No categories: all of them. With debug logging off errors are still logged, since
 * a status without its reason serves nobody; an importer that names categories gets those alone. false with a warning
 * logged where a name is unknown (the others hold). */
bool log_select(Unit *unit, bool on, size_t count, const fmi2String names[]);

#endif
