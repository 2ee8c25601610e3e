/* The interpreter that a unit may bring with all packages that it needs: resources/standalone/PLATFORM/unit. */
#ifndef BROUGHT_H
#define BROUGHT_H

#include "text.h"

typedef enum {
    BRINGS_NONE,
    BRINGS_ONE,  /* for this platform */
    BRINGS_OTHER /* or it cannot be executed; `fault` says so */
} Brought;

/* `program` is its path, the caller's to free. */
Brought brought_interpreter(const char *resources, char **program, Text *fault);

#endif
