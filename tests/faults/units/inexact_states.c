/* y = (1 + t) (1 + share n / 5), where n counts steps and is not part of the state: outputs from a restored state are
 * off by about `share` of the signal, after the five steps that a check repeats. */
#include "frame/unit.h"

enum { MAX_INSTANCES = 64 };

typedef struct {
    double y, share;
} Inexact;

static struct {
    const Unit *unit;
    int steps;
} forgotten[MAX_INSTANCES];

static int *steps_of(const Unit *unit) {
    int i = 0;
    while (i < MAX_INSTANCES - 1 && forgotten[i].unit && forgotten[i].unit != unit)
        i++;
    forgotten[i].unit = unit;
    return &forgotten[i].steps;
}

static void initialize(Unit *unit) { *steps_of(unit) = 0; }
static void outputs(Unit *unit) {
    SELF(Inexact);
    self->y = (1 + unit->kept->time) * (1 + self->share * *steps_of(unit) / 5);
}
static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    ++*steps_of(unit);
    return OK;
}

#define INEXACT(name, off)                                                                                             \
    static const Variable of_##name[] = {                                                                              \
        {"y", OUTPUT, REAL, offsetof(Inexact, y)},                                                                     \
        {"share", PARAMETER, REAL, offsetof(Inexact, share), .start = off},                                            \
    };                                                                                                                 \
    static const Model name = {                                                                                        \
        #name, of_##name, COUNT(of_##name), 0.1, 0, sizeof(Inexact), .initialize = initialize, .outputs = outputs,     \
        .step = step,                                                                                                  \
    };                                                                                                                 \
    UNIT(name)
INEXACT(state_off_by_1e6, 1e-6)
INEXACT(state_off_by_1e4, 1e-4)
INEXACT(state_off_by_1e2, 1e-2)
