/* The interpreter bundled with a unit, with all packages that it needs: resources/standalone/PLATFORM/unit. */
#ifndef BUNDLED_H
#define BUNDLED_H

#include "text.h"

typedef enum {
    NO_BUNDLE,
    BUNDLED,        /* for this platform */
    UNUSABLE_BUNDLE /* for another one, or it cannot be executed; `fault` says so */
} Bundle;

/* `program` is its path, the caller's to free. */
Bundle bundled_interpreter(const char *resources, char **program, Text *fault);

#endif
