/* One instance of a unit, whatever the standard: its modes, its variables' buffers, its Python side.
 *
 * fmi2.c and fmi3_*.c translate the standards' functions into these. `function` is always the name of the standard's
 * function that the host called; it begins the log line of every refusal.
 *
 * A refused call (wrong mode, unknown variable, NULL) changes nothing, be it refused here or by a Python exception
 * with a true `is_refusal`. A failure in the block's own code puts the instance into the mode FAILED: it can be reset,
 * set back to a saved state, or freed.
 */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "text.h"

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
    uint64_t abilities;                         /* HAS_... of the block, as the host is told */
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
    unsigned logged; /* the LOG_... that the host wants; errors are always told */

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

/* log.c */

enum { LOG_WARNINGS = 1, LOG_NOTES = 2, LOG_EVERYTHING = 3 };

#define CATEGORY_ERROR "logStatusError"
#define CATEGORY_WARNING "logStatusWarning"
#define CATEGORY_ALL "logAll"

Status refuse(const Instance *instance, const char *function, const char *format, ...);
void warn(const Instance *instance, const char *function, const char *format, ...);
void note(const Instance *instance, const char *function, const char *format, ...);
Status refuse_unsupported(const Instance *instance, const char *function, const char *reason);
/* A file of the FMU's sources is not where it is to be. */
void refuse_unreadable(const Instance *instance, const char *function, const char *path);

/* Whether the function may be called now; if not, says so in the log. */
bool allowed(const Instance *instance, const char *function, unsigned modes);
bool given(const Instance *instance, const char *function, const void *pointer, const char *what);
Status set_logging(Instance *instance, const char *function, bool on, size_t n, const char *const categories[]);

/* variables.c */

/* Takes over the table that describes the buffers. The addresses in it are off by `shift`, where another process wrote
 * them, which has mapped the memory that both share to another place. */
bool take_table(Instance *instance, const char *bytes, size_t size, uint64_t shift);

/* The variable of a checked value reference. */
static inline const Variable *variable_of(const Instance *instance, uint32_t reference) {
    return &instance->variables[reference];
}

static inline const char *name_of(const Instance *instance, const Variable *variable) {
    return instance->names + variable->name;
}

/* Whether all real inputs are finite; if not, says so in the log. */
bool inputs_finite(const Instance *instance, const char *function);
/* Whether all real outputs are, and those of type Float32 within its range. If not, the block has got there by itself,
 * so it is of no further use: the mode is FAILED. */
Status check_outputs(Instance *instance, const char *function);

/* slave.c: calls into Python, wherever it runs (side.h). Those that change the block (call, step, set_state) put the
 * instance into the mode FAILED if they fail otherwise than by a refusal; all do if the interpreter is gone. */

bool slave_start(Instance *instance, const char *function, const char *resources, const char *token);
void slave_release(Instance *instance);
bool slave_revive(Instance *instance, const char *function); /* so that a call can be made, if there is a way */
Status slave_call(Instance *instance, const char *function, const char *method);
Status slave_step(Instance *instance, const char *function);
Status slave_get_state(Instance *instance, const char *function, char **bytes, size_t *size);
Status slave_set_state(Instance *instance, const char *function, const char *bytes, size_t size);
/* The real outputs' derivative in a direction of the real inputs, both as they lie in `floats`. */
Status slave_derivative(Instance *instance, const char *function, const double seed[], double sensitivity[]);
Status slave_get_string(Instance *instance, const char *function, size_t index, const char **value);
Status slave_set_string(Instance *instance, const char *function, size_t index, const char *value);

/* lifecycle.c: the modes from instantiation to the end */

Instance *instance_new(const char *name, Logger *log, void (*host_logger)(void), void *environment, bool logging);
void instance_free(Instance *instance);
Status instance_set_times(Instance *instance, const char *function, double start, bool has_stop, double stop);
Status instance_enter_initialisation(Instance *instance, const char *function);
Status instance_exit_initialisation(Instance *instance, const char *function);
Status instance_terminate(Instance *instance, const char *function);
Status instance_reset(Instance *instance, const char *function);
Status instance_refresh_outputs(Instance *instance, const char *function);

/* sampling.c: ticks of a sampled block */

static inline bool is_sampled(const Instance *instance) { return instance->period_counter != 0; }
static inline bool has_clock(const Instance *instance) { return instance->abilities & HAS_CLOCK; }
double period(const Instance *instance);
Status sampling_step(Instance *instance, const char *function, double t, double dt, StepEnd *end);
Status sampling_activate(Instance *instance, const char *function);
Status sampling_evaluate(Instance *instance, const char *function);
Status sampling_settle(Instance *instance, const char *function);

/* stepping.c: steps, and event mode between them */

static inline bool has_events(const Instance *instance) { return instance->abilities & HAS_EVENTS; }
Status instance_step(Instance *instance, const char *function, double t, double dt, StepEnd *end);
Status events_enter(Instance *instance, const char *function);
Status events_leave(Instance *instance, const char *function);
Status events_update(Instance *instance, const char *function, double *next_event);

/* derivatives.c */

/* J seed of the real outputs `unknowns` by the real inputs `knowns`; `adjoint` gives seed J instead. */
Status get_derivative(Instance *instance, const char *function, bool adjoint, const uint32_t unknowns[], size_t n_unknowns,
                      const uint32_t knowns[], size_t n_knowns, const double seed[], size_t n_seed,
                      double sensitivity[], size_t n_sensitivity);

/* values.c */

/* Whether these variables may be read (written) now and have `values` entries altogether. Reading brings outputs up to
 * date, writing marks them stale. */
bool may_get(Instance *instance, const char *function, Kind kind, Type type, const uint32_t references[], size_t n,
             const void *values, size_t n_values);
bool may_set(Instance *instance, const char *function, Kind kind, Type type, const uint32_t references[], size_t n,
             const void *values, size_t n_values);

/* Whether an integer variable takes a number. */
bool takes_integer(const Instance *instance, const char *function, uint32_t reference, int64_t number);

Status get_floats(Instance *instance, const char *function, Type type, const uint32_t vr[], size_t n, double values[],
                  size_t);
Status set_floats(Instance *instance, const char *function, Type type, const uint32_t vr[], size_t n,
                  const double values[], size_t);
Status get_singles(Instance *instance, const char *function, const uint32_t vr[], size_t n, float values[], size_t);
Status set_singles(Instance *instance, const char *function, const uint32_t vr[], size_t n, const float values[],
                   size_t);
Status get_strings(Instance *instance, const char *function, Type type, const uint32_t vr[], size_t n,
                   const char *values[], size_t);
Status set_strings(Instance *instance, const char *function, Type type, const uint32_t vr[], size_t n,
                   const char *const values[], size_t);

/* state.c */

Status state_get(Instance *instance, const char *function, void **state);
Status state_set(Instance *instance, const char *function, void *state);
Status state_free(Instance *instance, const char *function, void **state);
Status state_size(Instance *instance, const char *function, void *state, size_t *size);
Status state_serialise(Instance *instance, const char *function, void *state, void *bytes, size_t size);
Status state_deserialise(Instance *instance, const char *function, const void *bytes, size_t size, void **state);
void states_free(Instance *instance);

#endif
