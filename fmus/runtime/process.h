/* The Python process of an instance, and the channel to it. */
#ifndef PROCESS_H
#define PROCESS_H

#include <stdbool.h>
#include <stddef.h>

#include "shared_memory.h"
#include "text.h"

typedef struct Process Process;

typedef enum {
    TRANSFERRED,
    ENDED,   /* the process has ended, or closed its end of the channel */
    TOO_LATE /* the deadline passed */
} Transfer;

/* Starts `interpreter arguments... HOST CHANNEL MEMORY`: the last three, numbers, are the host's process, with which it
 * ends, and its ends of the channel and of the shared memory (descriptors; on Windows handles). It inherits nothing else but, on POSIX, standard output and standard error.
 * On failure returns NULL and adds why to `fault`. */
Process *process_start(const char *interpreter, const char *const arguments[], const SharedMemory *memory, Text *fault);

/* The same for a unit that brings its interpreter, of which one process serves all instances that this host makes: it is
 * started with the first as `program arguments... HOST CONTROL`, and ends with the last. A unit is the same if its token
 * and the program's file are. Of the host's environment the process gets only where it may write. On Windows each
 * instance has a process of its own. */
Process *process_join(const char *program, const char *token, const char *const arguments[], const SharedMemory *memory,
                      Text *fault);

/* Seconds of a monotonic clock. */
double process_clock(void);

/* Transfers all of `size` bytes, or says why not; `deadline` is of the clock above, infinity is none. */
Transfer process_send(Process *process, const void *bytes, size_t size, double deadline);
Transfer process_receive(Process *process, void *bytes, size_t size, double deadline);

bool process_runs(const Process *process);

/* Closes the channel, at which the process ends by itself; after `patience` seconds it is killed. Frees `process` and
 * says how it ended; returns its exit status, or -1 if it was ended by something else. */
int process_end(Process *process, double patience, Text *how);

#endif
