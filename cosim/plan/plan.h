/* A run of fixed steps as a flat list of operations over memory that the Python side owns.
 *
 * The same layout is in `plan_maker.py` (operations) and `memory.py` (the rest): what changes here changes there. */
#ifndef PLAN_H
#define PLAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum kind {
    COPY,        /* bytes as they are */
    CONVERT,     /* numbers of one type to another */
    SCALE,       /* reals, times a factor, plus an offset */
    FITS,        /* integers must lie between two bounds */
    FINITE,      /* reals must be neither infinite nor NaN */
    ACCESS_2,    /* fmi2Set*, fmi2Get* */
    ACCESS_3,    /* fmi3Set*, fmi3Get* */
    BINARIES_3,  /* fmi3SetBinary, fmi3GetBinary */
    KEEP_BYTES,  /* copy binaries that a unit gave, since it may reuse its memory */
    KEEP_TEXTS,  /* likewise texts */
    STEP_2,      /* fmi2DoStep */
    STEP_3,      /* fmi3DoStep */
    START_CLOCK, /* read the CPU clock */
    CHARGE,      /* charge the CPU time since it was read to a unit */
    BEGIN_STEP   /* begin the step of an isolated unit, which STEP_2 or STEP_3 waits for */
};

enum type { BOOL8, INT8, INT16, INT32, INT64, UINT8, UINT16, UINT32, UINT64, FLOAT32, FLOAT64 };

typedef void (*Function)(void);

typedef struct {
    void *memory;
    size_t size;
} Kept;

typedef struct {
    bool event_needed, terminate, early;
    double last_time;
} StepFlags;

typedef struct {
    int32_t kind;
    int32_t unit;
    int64_t code; /* of a call: its number in the heartbeat; else -1 */
    union {
        struct {
            void *to;
            const void *from;
            size_t n; /* bytes of COPY, else numbers */
            int32_t to_type, from_type;
            double factor, offset;
        } copy;
        struct {
            const void *values;
            size_t n;
            int64_t type, low;
            uint64_t high;
        } check;
        struct {
            Function function;
            void *component;
            const uint32_t *references;
            size_t n_references;
            void *values;
            size_t n_values;
            size_t *sizes;
        } access;
        struct {
            void **addresses;
            const size_t *sizes;
            size_t n;
            Kept *kept;
        } keep;
        struct {
            Function function;
            void *component;
            double step;
            bool *event_needed, *terminate, *early;
            double *last_time;
        } step;
        struct {
            double *own; /* CPU time of an isolated unit's process that was not charged yet */
        } charge;
    };
} Operation;

_Static_assert(sizeof(Operation) == 72, "plan_maker.py packs an operation into 72 bytes");

/* Operations of units that are due together; those of group -1 are executed at every communication point. */
typedef struct {
    int64_t group, first, end;
} Segment;

/* Units with the same step, which are therefore always due together. */
typedef struct {
    int64_t every, due, acted, sampled;
} Group;

typedef struct {
    const void *values;
    char *rows;
    size_t bytes;
} Part;

typedef struct {
    int64_t *filled;
    double *time;
    int64_t capacity;
    const Part *parts;
    int64_t n_parts;
} Record;

/* How often a call answered Warning, and the simulated time of the first. */
typedef struct {
    int64_t n;
    double first;
} Warned;

/* Cells of the heartbeat, see heartbeat.py: which call is under way (-1: none), how many calls began, the simulated time
 * (a double), and whether the units were taken from this thread. */
enum cell { DOING, COUNT, TIME, TAKEN };

enum outcome { LAST_REACHED, PAUSED, RECORD_FULL, STOPPED, ABANDONED };

typedef struct {
    const Operation *operations;
    const Segment *arrive, *depart;
    Group *groups;
    int64_t n_arrive, n_depart, n_groups;
    int64_t offset; /* of tick 0, in parts of a second as the numerator has them */
    uint64_t numerator, denominator; /* of a tick in seconds */
    int64_t tick;
    double time;
    double *unit_times;
    double *spent; /* CPU seconds, `spent_capacity` of each unit */
    int64_t *n_spent;
    int64_t spent_capacity;
    double clock;
    volatile int64_t *heartbeat;
    int64_t stopped_at; /* the operation that failed */
    int64_t status;     /* what it returned */
    const volatile char *identity; /* 0 in a process that a unit has forked from this one, see host_process.py */
    uint64_t float_control;        /* of the thread that calls the plan */
    Warned *warned;                /* of each operation */
} Plan;

double exact_time(int64_t offset, uint64_t ticks, uint64_t numerator, uint64_t denominator);
enum outcome carry_out(Plan *plan, const Segment *segment);

#endif
