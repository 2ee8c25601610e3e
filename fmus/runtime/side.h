/* Where an instance's Python side runs: in the host's process (embedded.c), or in a process of its own (remote.c).
 *
 * The environment variable FMU_PYTHON_PROCESS decides: 1, a process of its own; 0, never; not set, only where the
 * host's process cannot have a usable Python. In the host's process a step is cheaper, but a block that never returns
 * or ends its process does that to the host, too.
 */
#ifndef SIDE_H
#define SIDE_H

#include "instance.h"
#include "text.h"

typedef enum {
    ANSWERED,
    REFUSED, /* the call was rejected; nothing has changed */
    RAISED,  /* the block's own code failed; its state may be half changed */
    LOST     /* the interpreter is gone */
} Outcome;

/* A method of fmus/slave.py with its arguments. */
typedef struct {
    const char *method;
    const size_t *index; /* the first argument, a number; NULL if there is none */
    const char *bytes;   /* the next; NULL if there is none */
    size_t size;
} Question;

/* The bytes that a method returned; a NUL follows the last. The caller frees them, or gives NULL if it wants none. */
typedef struct {
    char *bytes;
    size_t size;
} Answer;

/* Whatever is not ANSWERED is in the log when these return. */
struct Side {
    Outcome (*ask)(const Instance *instance, const char *function, const Question *question, Answer *answer);
    Outcome (*step)(const Instance *instance, const char *function);
    bool (*revive)(Instance *instance, const char *function); /* an interpreter in place of one that is gone */
    void (*release)(Instance *instance);
};

typedef enum { STARTED, NOT_STARTED, NO_PYTHON } Start; /* NOT_STARTED is in the log, NO_PYTHON in `tried` */

Start embedded_start(Instance *instance, const char *function, const char *resources, const char *token, Text *tried);
Start remote_start(Instance *instance, const char *function, const char *resources, const char *token, Text *tried);

/* In the interpreter that the unit brings, `program`; neither embedded nor another process is tried besides. */
Start bundled_start(Instance *instance, const char *function, const char *resources, const char *token,
                    const char *program, Text *tried);

#endif
