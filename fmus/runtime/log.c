/* Messages to the host's logger. Errors are always logged, as the standards recommend; warnings and notes while logging
 * is on and their category is among those that the host has chosen. */
#include <string.h>

#include "log.h"
#include "text.h"

static void say(const Instance *instance, Status status, const char *category, const char *function, const char *format,
                va_list arguments) {
    if (!instance || !instance->host_logger) return;
    Text message = {0};
    text_add(&message, "%s: ", function);
    text_add_list(&message, format, arguments);
    instance->log(instance, status, category, text_of(&message));
    text_clear(&message);
}

Status refuse(const Instance *instance, const char *function, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    say(instance, STATUS_ERROR, CATEGORY_ERROR, function, format, arguments);
    va_end(arguments);
    return STATUS_ERROR;
}

void warn(const Instance *instance, const char *function, const char *format, ...) {
    if (!(instance->logged & LOG_WARNINGS)) return;
    va_list arguments;
    va_start(arguments, format);
    say(instance, STATUS_WARNING, CATEGORY_WARNING, function, format, arguments);
    va_end(arguments);
}

void note(const Instance *instance, const char *function, const char *format, ...) {
    if (!(instance->logged & LOG_NOTES)) return;
    va_list arguments;
    va_start(arguments, format);
    say(instance, STATUS_OK, CATEGORY_ALL, function, format, arguments);
    va_end(arguments);
}

Status refuse_unsupported(const Instance *instance, const char *function, const char *reason) {
    return refuse(instance, function, "not supported: %s", reason);
}

void refuse_unreadable(const Instance *instance, const char *function, const char *path) {
    refuse(instance, function,
           "%s cannot be read: the resources folder lacks it. Either the resource location is wrong, or the FMU was "
           "taken apart. Cure: give the location of the unpacked FMU's folder resources, or build the FMU again",
           path);
}

static const char *mode_name(Mode mode) {
    switch (mode) {
        case INSTANTIATED: return "instantiated";
        case INITIALISATION: return "initialisation mode";
        case STEPPING: return "step mode";
        case EVENT: return "event mode";
        case TERMINATED: return "terminated";
        case FAILED: return "failed: only reset, a saved state or free help";
        default: return "unknown";
    }
}

bool allowed(const Instance *instance, const char *function, unsigned modes) {
    if (!instance) return false; /* and so no logger */
    if (modes & instance->mode) return true;
    refuse(instance, function, "not allowed now, the instance is in this state: %s", mode_name(instance->mode));
    return false;
}

bool given(const Instance *instance, const char *function, const void *pointer, const char *what) {
    if (pointer) return true;
    refuse(instance, function, "the argument %s is NULL", what);
    return false;
}

Status set_logging(Instance *instance, const char *function, bool on, size_t n, const char *const categories[]) {
    if (!instance) return STATUS_ERROR;
    if (n > 0 && !given(instance, function, categories, "categories")) return STATUS_ERROR;
    unsigned logged = n == 0 ? LOG_EVERYTHING : 0;
    for (size_t i = 0; i < n; i++) {
        const char *category = categories[i] ? categories[i] : "NULL";
        if (strcmp(category, CATEGORY_ALL) == 0)
            logged = LOG_EVERYTHING;
        else if (strcmp(category, CATEGORY_WARNING) == 0)
            logged |= LOG_WARNINGS;
        else if (strcmp(category, CATEGORY_ERROR) != 0)
            return refuse(instance, function, "unknown log category '%s'; known: " CATEGORY_ERROR ", " CATEGORY_WARNING
                          ", " CATEGORY_ALL, category);
    }
    instance->logged = on ? logged : 0;
    return STATUS_OK;
}
