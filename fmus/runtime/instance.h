/* One instance of a unit, whatever the standard: its mode, its variables' buffers, its Python side.
 *
 * fmi2.c and fmi3_*.c translate the standards' functions into calls of these files, which are layers: each calls only
 * those below it.
 *
 *     values.c, derivatives.c   variables, read and written; partial derivatives of outputs by inputs
 *     lifecycle.c, stepping.c   modes from instantiation to the end; steps and event mode
 *     sampling.c, state.c       ticks of a sampled block; saved states
 *     slave.c                   calls into Python
 *     bundled.c                 the interpreter that a standalone unit brings
 *     embedded.c, remote.c      Python in the host's process, or in one of its own
 *     variables.c               the table of variables, checks of their values
 *     log.c                     messages to the host's logger
 *
 * In all of them `function` is the name of the standard's function that the host called; the log line of every
 * rejected call begins with it.
 *
 * A rejected call (wrong mode, unknown variable, NULL) changes nothing, be it rejected here or by a Python exception
 * with a true `is_refusal`. A failure in the block's own code puts the instance into the mode FAILED: it can be reset,
 * restored to a saved state, or freed.
 */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The values are those of fmi2Status and fmi3Status. */
typedef enum { STATUS_OK, STATUS_WARNING, STATUS_DISCARD, STATUS_ERROR } Status;

typedef enum {
    INSTANTIATED = 1,
    INITIALISATION = 2,
    STEPPING = 4,
    EVENT = 8,
    TERMINATED = 16,
    FAILED = 32,
    ANY_MODE = 63
} Mode;

/* The numbers in these two, and the structures below, are written by fmus/table.py (and layout.py). */
typedef enum { FLOAT64, INT64, BOOLEAN, STRING, BINARY } Kind;
typedef enum { PARAMETER, INPUT, OUTPUT, INDEPENDENT } Causality;

enum { HAS_EVENTS = 1, HAS_DERIVATIVES = 2, HAS_CLOCK = 4 };

/* Types of FMI 3. FMI 2 knows kinds only: ANY_TYPE stands for all of a kind. */
typedef enum {
    ANY_TYPE,
    TYPE_FLOAT64,
    TYPE_FLOAT32,
    TYPE_INT8,
    TYPE_UINT8,
    TYPE_INT16,
    TYPE_UINT16,
    TYPE_INT32,
    TYPE_UINT32,
    TYPE_INT64,
    TYPE_UINT64,
    TYPE_ENUMERATION,
    TYPE_BOOLEAN,
    TYPE_STRING,
    TYPE_BINARY
} Type;

/* What a value reference stands for: `count` entries from `offset` on in the buffer of its kind. */
typedef struct {
    uint8_t kind, causality;
    uint16_t type;
    uint32_t count, offset, name;
} Variable;

/* A binary variable's buffer. A picture's size is exact: only `capacity` bytes make one. */
typedef struct {
    uint64_t address, capacity, exact;
} BinaryBuffer;

typedef struct {
    uint64_t floats, integers, booleans, sizes; /* addresses; floats begin with the time and the step size */
    uint64_t first_input, inputs;               /* where the real inputs lie in `floats` */
    uint64_t first_output, outputs;             /* likewise */
    uint64_t variables, binaries, names;        /* entries and bytes of what follows this structure */
    uint64_t abilities;                         /* HAS_... of the block, as in the XML */
    uint64_t period_counter, period_resolution; /* a sampled block's period is counter / resolution seconds; 0: not sampled */
} TableHeader;

/* How far a run has come with its ticks and events; part of a saved state. */
typedef struct {
    double start;          /* ticks are counted from here */
    uint64_t ticks;        /* done since */
    uint8_t clock_active;  /* set by the host, its tick not yet settled */
    uint8_t evaluated;     /* the active clock's tick was worked out for a reader of outputs */
    uint8_t tick_told;     /* a step returned early because of the tick that is due */
    uint8_t event_pending; /* a step stopped at an event that is not yet handled */
    uint8_t clock_used;    /* the host has activated the clock once */
    uint8_t ticks_alone;   /* it has not, and left out a tick: the unit ticks by itself, as without event mode */
    uint8_t unused[2];
} Events;

/* How a step ended. */
typedef struct {
    bool early, event_needed;
} StepEnd;

typedef struct Instance Instance;
typedef struct SavedState SavedState;
typedef struct Side Side;
typedef void Logger(const Instance *instance, Status status, const char *category, const char *message);

struct Instance {
    char *name;
    Logger *log;
    void (*host_logger)(void); /* the host's own function, called by `log` */
    void *host_environment;
    unsigned logged; /* the LOG_... that the host wants; errors are always logged */

    Mode mode;
    bool event_mode_used, early_return_allowed;
    bool has_outputs;   /* the outputs were worked out at least once since the start */
    bool outputs_stale; /* in initialisation mode something was set after they were */
    double stop_time;   /* infinity if there is none */
    Events events;

    const Side *side; /* where Python runs, */
    void *python;     /* and what that way of running it has of this instance */
    char **strings;   /* those that the host got, until it gets them again */
    size_t n_strings;

    char *table; /* owns what the following point into */
    const Variable *variables;
    const BinaryBuffer *binaries;
    const char *names;
    size_t n_variables;
    double *floats;
    int64_t *integers;
    uint8_t *booleans;
    uint64_t *sizes;
    size_t first_input, n_inputs, first_output, n_outputs;
    bool gives_singles; /* there are Float32 outputs */
    uint64_t abilities, period_counter, period_resolution;

    SavedState *states;
};

#endif
