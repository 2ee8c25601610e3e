/* What process_posix.c and process_shared.c share. */
#ifndef PROCESS_POSIX_H
#define PROCESS_POSIX_H

#include <sys/types.h>

#include "process.h"

typedef struct SharedProcess SharedProcess;

struct Process {
    pid_t id, host; /* a host may fork: only the one that started the process ends it */
    int channel;
    SharedProcess *shared; /* NULL: the process is this instance's own */
};

typedef enum { RUNS, IS_OVER, IS_REAPED } Life;

/* A process that is over stays to be reaped, unless the host reaps whatever it can. */
Life process_life(pid_t id);

/* Two ends of a channel that no process inherits by accident. */
bool process_open_channel(int ends[2]);

/* Starts `program arguments... HOST CONTROL`, `program` being a path; of the host's environment only HOME and TMPDIR reach
 * it. */
bool process_start_alone(const char *program, const char *const arguments[], pid_t *id, int *control, Text *fault);

/* Waits, kills what is left of the process's group, and gives how it ended; false if the host has reaped it itself. */
bool process_reap(pid_t id, double patience, int *status);
void process_describe(int status, Text *how);

/* Takes an instance off a shared process, which ends with its last one, or at once if there is to be no patience. True
 * if it is over; then `status` is how it ended, and `was_silent` whether it was for want of an answer to any instance. */
bool process_leave(SharedProcess *shared, double patience, int *status, bool *was_silent);

#endif
