/* Gives what it was initialised with: start and stop time and the tolerance, -1 where undefined, and the present time.
 *
 * It refuses a step that ends after its stop time, by the last bit. */
#include "frame/unit.h"

typedef struct {
    double start, stop, tolerance, now;
} Clerk;

static const Variable variables[] = {
    {"start", OUTPUT, REAL, offsetof(Clerk, start), .unit = "s"},
    {"stop", OUTPUT, REAL, offsetof(Clerk, stop), .unit = "s"},
    {"tolerance", OUTPUT, REAL, offsetof(Clerk, tolerance)},
    {"now", OUTPUT, REAL, offsetof(Clerk, now), .unit = "s"},
};

static void initialize(Unit *unit) {
    SELF(Clerk);
    self->start = self->now = unit->kept->start;
    self->stop = unit->kept->stop;
    self->tolerance = unit->kept->tolerance;
}

static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Clerk);
    if (self->stop != -1 && t + h > self->stop) {
        say(unit, ERROR, "a step to %.17g s, which is after the stop time %.17g s", t + h, self->stop);
        return ERROR;
    }
    self->now = t + h;
    return OK;
}

static const Model clerk = {
    "clerk", variables, COUNT(variables), 0.1, 0, sizeof(Clerk), .initialize = initialize, .step = step,
};
UNIT(clerk)
