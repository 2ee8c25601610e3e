/* Messages to the host's logger, and the checks with which every function begins. */
#ifndef LOG_H
#define LOG_H

#include "instance.h"

enum { LOG_WARNINGS = 1, LOG_NOTES = 2, LOG_EVERYTHING = 3 };

#define CATEGORY_ERROR "logStatusError"
#define CATEGORY_WARNING "logStatusWarning"
#define CATEGORY_ALL "logAll"

/* All three take a printf format; `refuse` returns STATUS_ERROR, so that a caller can return what it returns. */
Status refuse(const Instance *instance, const char *function, const char *format, ...);
void warn(const Instance *instance, const char *function, const char *format, ...);
void note(const Instance *instance, const char *function, const char *format, ...);

Status refuse_unsupported(const Instance *instance, const char *function, const char *reason);
/* Logs that a file of the FMU's sources is missing. */
void refuse_unreadable(const Instance *instance, const char *function, const char *path);

/* Whether the function may be called now; if not, says so in the log. */
bool allowed(const Instance *instance, const char *function, unsigned modes);
bool given(const Instance *instance, const char *function, const void *pointer, const char *what);
Status set_logging(Instance *instance, const char *function, bool on, size_t n, const char *const categories[]);

#endif
