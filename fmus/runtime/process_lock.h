/* A lock that this library shares with all others in the process: each FMU brings its own copy of this code, but a
 * process has one Python, which must not be started by two threads at the same time. */
#ifndef PROCESS_LOCK_H
#define PROCESS_LOCK_H

#include <stdbool.h>
#include <stdint.h>

#include "text.h"

typedef struct {
    intptr_t handle;
    Text path;
} ProcessLock;

/* Waits for the lock. If there is none, returns false and adds why to `fault`. */
bool process_lock(ProcessLock *lock, Text *fault);
void process_unlock(ProcessLock *lock);

#endif
