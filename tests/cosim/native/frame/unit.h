/* A unit under test: a table of variables over a struct, and a few functions, make an FMU of both standards.
 *
 * Each `../NAME.c` declares one or a few. A variable's value reference is its place in the table, counted from 1, in
 * FMI 2 among the variables of its type, as the standard tells them apart by it; 0 is the independent variable of FMI 3. `native_units.py` reads the tables out of the compiled library, so that nothing is
 * declared twice. */
#ifndef UNIT_H
#define UNIT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum status { OK, WARNING, DISCARD, ERROR, FATAL };
enum causality { PARAMETER, INPUT, OUTPUT };
enum type { REAL, INTEGER, BOOLEAN, BINARY, CLOCK };
enum mode { INSTANTIATED = 1, INITIALIZATION = 2, STEP = 4, EVENT = 8, TERMINATED = 16 };
enum { MAX_VARIABLES = 16, MAX_ORDER = 2, MAX_BYTES = 248 };

typedef struct {
    size_t size;
    uint8_t bytes[MAX_BYTES];
} Bytes;

/* The fields of the unit's struct are double, int32_t, int32_t, Bytes and int32_t, by type; an array has `length`. */
typedef struct {
    const char *name;
    int causality, type;
    size_t offset, length;
    double start;
    const char *unit;       /* a name of the table of units in native_units.py */
    const char *depends;    /* of an output: the inputs that it depends on at once, with blanks between */
    const char *clock;      /* the clock that a clocked variable belongs to */
    int discrete;           /* a real that changes at events or steps only */
    int counter, resolution; /* of a clock: its constant interval is counter/resolution s; without, it is triggered */
    const char *timing;      /* of a clock: its intervalVariability, if the model tells its intervals */
} Variable;

typedef struct Unit Unit;

typedef struct {
    bool event_needed, terminate, early;
    double last_time; /* until where the step got; t + h unless the unit says otherwise */
} StepEnd;

typedef struct {
    bool again, next_defined, terminate;
    double next;
} Update;

/* what a unit cannot do, or can beyond the ordinary */
enum ability { NO_STATES = 1, FIXED_STEP = 2, INTERPOLATES = 4, DERIVATIVES = 8, EVENTS = 16, EARLY_RETURN = 32,
               SECRET_PARAMETERS = 64, TUNABLE_PARAMETERS = 128 };

/* The first fields, down to `abilities`, are read by native_units.py. */
typedef struct {
    const char *name;
    const Variable *variables;
    size_t n_variables;
    double proposed_step;
    int abilities;
    size_t size;
    void (*created)(Unit *);                                     /* an instance is there */
    void (*initialize)(Unit *);                                  /* states from parameters */
    void (*outputs)(Unit *);                                     /* outputs from states and inputs */
    enum status (*step)(Unit *, double t, double h, StepEnd *);
    void (*update)(Unit *, Update *);                            /* discrete states, at an event */
    int (*interval)(Unit *, double *);                           /* of its clock that has a `timing`: what
                                                                    fmi3IntervalQualifier it is */
    enum status (*terminate)(Unit *);                            /* what Terminate answers */
    void (*freed)(Unit *);                                       /* the instance is about to be freed */
    void (*set)(Unit *);                                         /* a variable is about to be set */
} Model;

/* All of it that a saved state holds lies in one block, `kept`. */
typedef struct {
    double time, last_time, last_step;
    double start, stop, tolerance; /* as the instance was initialised; stop and tolerance are -1 where undefined */
    int32_t mode, terminated, stale; /* stale: inputs were set since outputs were computed */
    double rates[MAX_VARIABLES][MAX_ORDER];
    _Alignas(16) unsigned char data[]; /* the unit's struct, and again as it was before the last step */
} Kept;

struct Unit {
    const Model *model;
    int fmi;     /* the standard's version, 2 or 3 */
    void *owner; /* of the standard's side: how to log */
    bool event_mode, early_return;
    char name[128];
    void (*log)(Unit *, enum status, const char *message);
    void *environment;
    Kept *kept;
};

#define SELF(Type) Type *self = (Type *)unit->kept->data
#define COUNT(table) (sizeof(table) / sizeof *(table))
#define UNIT(model)                                                                                                    \
    __attribute__((constructor)) static void declare_##model(void) { add_model(&model); }

void add_model(const Model *model);
void say(Unit *unit, enum status status, const char *format, ...) __attribute__((format(printf, 3, 4)));

/* An input `since` seconds after the step began, by the time derivatives that were set. */
double input_at(Unit *unit, const double *field, double since);

/* x'' = a(t, x, x') over h, by the classical Runge-Kutta method with steps of at most 1 ms. */
typedef double (*Acceleration)(Unit *unit, double since, double x, double v);
void runge_kutta(Unit *unit, Acceleration a, double h, double *x, double *v);

/* for the standards' sides */
Unit *new_unit(const char *token, const char *name);
void free_unit(Unit *unit);
void begin(Unit *unit);
void set_up(Unit *unit, bool has_tolerance, double tolerance, double start, bool has_stop, double stop);
bool allowed(Unit *unit, int modes, const char *call);
const Variable *variable(Unit *unit, uint32_t reference, enum type type, bool to_set, const char *call);
void *place(Unit *unit, const Variable *v);
void refresh(Unit *unit);
enum status do_step(Unit *unit, double t, double h, StepEnd *end);
enum status sensitivity(Unit *unit, const uint32_t *unknown, size_t n, const uint32_t *known, size_t m,
                        const double *seed, double *change);
size_t kept_size(const Unit *unit);
enum status save(Unit *unit, void **state);
enum status restore(Unit *unit, const void *state);

#endif
