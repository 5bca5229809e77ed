#include "log.h"

#include <stdio.h>
#include <string.h>

#include "numbers.h"
#include "shell.h"
#include "text.h"

#define MESSAGE_SIZE 2048

static const struct {
    const char *name;
    unsigned categories;
    fmi2Status status;
} categories[] = {
    {"logStatusError", LOG_ERRORS, fmi2Error}, {"logStatusWarning", LOG_WARNINGS, fmi2Warning},
    {"logEvents", LOG_EVENTS, fmi2OK},         {"logFmi2Call", LOG_CALLS, fmi2OK},
    {"logAll", LOG_EVERYTHING, fmi2OK},
};
enum { CATEGORY_COUNT = sizeof categories / sizeof *categories };

/* The logger is a printf that also expands references to variables between number signs: both signs are doubled. */
static void escape(const char *text, char *escaped) {
    for (; *text; text++) {
        if (*text == '%' || *text == '#') {
            *escaped++ = *text;
        }
        *escaped++ = *text;
    }
    *escaped = '\0';
}

void log_write_list(Unit *unit, unsigned category, const char *format, va_list arguments) {
    if (!(unit->log_categories & category) || unit->callbacks.logger == NULL) {
        return;
    }
    char text[MESSAGE_SIZE], escaped[2 * MESSAGE_SIZE];
    int used = snprintf(text, sizeof text, "%s", call_name(unit->call));
    if (unit->call == CALL_DoStep) {
        char time[NUMBER_TEXT_SIZE], size[NUMBER_TEXT_SIZE];
        used += snprintf(text + used, sizeof text - (size_t)used, " (t = %s s, h = %s s)",
                         number_text(time, unit->step_time), number_text(size, unit->step_size));
    }
    used += snprintf(text + used, sizeof text - (size_t)used, ": ");
    vsnprintf(text + used, sizeof text - (size_t)used, format, arguments);
    text_mend(text);
    escape(text, escaped);
    for (int i = 0; i < CATEGORY_COUNT; i++) {
        if (categories[i].categories == category) {
            unit->callbacks.logger(unit->callbacks.componentEnvironment, unit->name != NULL ? unit->name : "",
                                   categories[i].status, categories[i].name, escaped);
            return;
        }
    }
}

void log_write(Unit *unit, unsigned category, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    log_write_list(unit, category, format, arguments);
    va_end(arguments);
}

bool unit_fail(Unit *unit, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    log_write_list(unit, LOG_ERRORS, format, arguments);
    va_end(arguments);
    return false;
}

void unit_warn(Unit *unit, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    log_write_list(unit, LOG_WARNINGS, format, arguments);
    va_end(arguments);
}

bool log_select(Unit *unit, bool on, size_t count, const fmi2String names[]) {
    if (!on || count == 0) {
        unit->log_categories = on ? LOG_EVERYTHING : LOG_ERRORS;
        return true;
    }
    unsigned chosen = 0;
    bool known = true;
    for (size_t i = 0; i < count; i++) {
        int k = 0;
        while (k < CATEGORY_COUNT && (names[i] == NULL || strcmp(names[i], categories[k].name) != 0)) {
            k++;
        }
        if (k < CATEGORY_COUNT) {
            chosen |= categories[k].categories;
        } else {
            known = false;
            unit_warn(unit,
                      "unknown log category '%s'; known are logStatusError, logStatusWarning, logEvents, "
                      "logFmi2Call and logAll",
                      names[i] != NULL ? names[i] : "(NULL)");
        }
    }
    unit->log_categories = chosen;
    return known;
}
