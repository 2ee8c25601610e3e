/* x' = u, y = x, and each ends its process in one way in one kind of call: `crashes_in_step`, `exits_in_get`, ...
 *
 * Calls that are made at each step do so when the unit has reached the time `at`. */
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "frame/unit.h"

typedef struct {
    double u, y, at;
} Ending;

static const Variable variables[] = {
    {"u", INPUT, REAL, offsetof(Ending, u), .start = 1},
    {"y", OUTPUT, REAL, offsetof(Ending, y)},
    {"at", PARAMETER, REAL, offsetof(Ending, at), .unit = "s", .start = 0.25},
};

static void crashes(Unit *unit) {
    say(unit, WARNING, "about to read what is not there");
    *(volatile int *)16 = 1;
}
static void exits(Unit *unit) {
    say(unit, WARNING, "about to leave");
    exit(0);
}
static void aborts(Unit *unit) {
    say(unit, WARNING, "about to give up");
    abort();
}
static void hangs(Unit *unit) {
    say(unit, WARNING, "about to wait for ever");
    for (;;)
        sleep(1);
}
/* What lies behind a block of the heap is written over, which is noticed when the heap is used next. */
static void overruns(Unit *unit) {
    say(unit, WARNING, "about to write too much");
    void *volatile blocks[64];
    for (int i = 0; i < 64; i++)
        blocks[i] = malloc(64);
    for (int i = 0; i < 64; i++)
        memset(blocks[i], 0x5a, 4096);
    for (int i = 0; i < 64; i++)
        free(blocks[i]);
    blocks[0] = malloc(1 << 20);
    free(blocks[0]);
}

static enum status integrate(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Ending);
    self->y += h * self->u;
    return OK;
}

static bool is_due(Unit *unit) {
    SELF(Ending);
    return unit->kept->time > self->at * (1 - 1e-12);
}

#define MODEL(fault, phase, ...)                                                                                       \
    static const Model fault##_in_##phase = {#fault "_in_" #phase, variables, COUNT(variables), 0.1, 0,                \
                                             sizeof(Ending), __VA_ARGS__};                                             \
    UNIT(fault##_in_##phase)

#define FAULT(fault)                                                                                                   \
    static void fault##_when_due(Unit *unit) {                                                                         \
        if (is_due(unit))                                                                                              \
            fault(unit);                                                                                               \
    }                                                                                                                  \
    static enum status fault##_or_integrate(Unit *unit, double t, double h, StepEnd *end) {                            \
        fault##_when_due(unit);                                                                                        \
        return integrate(unit, t, h, end);                                                                             \
    }                                                                                                                  \
    static enum status fault##_as_it_ends(Unit *unit) {                                                                \
        fault(unit);                                                                                                   \
        return OK;                                                                                                     \
    }                                                                                                                  \
    MODEL(fault, instantiate, .created = fault, .step = integrate)                                                     \
    MODEL(fault, initialize, .initialize = fault, .step = integrate)                                                   \
    MODEL(fault, set, .set = fault##_when_due, .step = integrate)                                                      \
    MODEL(fault, get, .outputs = fault##_when_due, .step = integrate)                                                  \
    MODEL(fault, step, .step = fault##_or_integrate)                                                                   \
    MODEL(fault, terminate, .terminate = fault##_as_it_ends, .step = integrate)                                        \
    MODEL(fault, free, .freed = fault, .step = integrate)

FAULT(crashes)
FAULT(exits)
FAULT(aborts)
FAULT(hangs)
FAULT(overruns)
