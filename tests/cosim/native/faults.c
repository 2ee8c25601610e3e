/* x' = u, y = x, and each does one thing as other people's units do, in the step that goes beyond the time `at`. */
#include <math.h>
#include <signal.h>
#include <stdlib.h>

#include "frame/unit.h"

typedef struct {
    double u, y, at;
} Faulty;

static const Variable variables[] = {
    {"u", INPUT, REAL, offsetof(Faulty, u), .start = 1},
    {"y", OUTPUT, REAL, offsetof(Faulty, y)},
    {"at", PARAMETER, REAL, offsetof(Faulty, at), .unit = "s", .start = 0.25},
};

static enum status integrate(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Faulty);
    self->y += h * self->u;
    return OK;
}

static bool beyond(Unit *unit, double end) {
    SELF(Faulty);
    return end > self->at * (1 + 1e-12);
}

static enum status answer_error(Unit *unit, double t, double h) {
    say(unit, ERROR, "the solver failed at t = %g", t);
    return ERROR;
}
static enum status answer_fatal(Unit *unit, double t, double h) {
    say(unit, FATAL, "memory is corrupt at t = %g", t);
    return FATAL;
}
static enum status give_nan(Unit *unit, double t, double h) {
    SELF(Faulty);
    self->y = NAN;
    return OK;
}
static enum status give_infinity(Unit *unit, double t, double h) {
    SELF(Faulty);
    self->y = -INFINITY;
    return OK;
}
static enum status hang(Unit *unit, double t, double h) {
    for (volatile int forever = 1; forever;)
        ;
    return OK;
}
static enum status crash(Unit *unit, double t, double h) {
    raise(SIGSEGV);
    return OK;
}
static enum status leave(Unit *unit, double t, double h) {
    exit(0);
}

static enum status end_simulation(Unit *unit, double t, double h, StepEnd *end) {
    end->terminate = beyond(unit, t + h);
    return integrate(unit, t, h, end);
}

static int instances;

static void crash_on_fifth(Unit *unit) {
    if (++instances == 5)
        raise(SIGSEGV);
}

#define FAULTY(name, abilities, created, step)                                                                         \
    static const Model name = {                                                                                        \
        #name, variables, COUNT(variables), 0.1, abilities, sizeof(Faulty), created, NULL, NULL, step,                 \
    };                                                                                                                 \
    UNIT(name)
#define AT_A_TIME(name, fault)                                                                                         \
    static enum status step_or_##fault(Unit *unit, double t, double h, StepEnd *end) {                                 \
        enum status status = integrate(unit, t, h, end);                                                               \
        return beyond(unit, t + h) ? fault(unit, t, h) : status;                                                       \
    }                                                                                                                  \
    FAULTY(name, 0, NULL, step_or_##fault)
AT_A_TIME(errs, answer_error)
AT_A_TIME(fatal, answer_fatal)
AT_A_TIME(gives_nan, give_nan)
AT_A_TIME(gives_infinity, give_infinity)
AT_A_TIME(hangs, hang)
AT_A_TIME(crashes, crash)
AT_A_TIME(exits, leave)
FAULTY(ends, 0, NULL, end_simulation)
FAULTY(crashes_on_fifth, 0, crash_on_fifth, integrate)
FAULTY(stateless, NO_STATES, NULL, integrate)
FAULTY(fixed_step, FIXED_STEP, NULL, integrate)
