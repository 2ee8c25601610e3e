/* x' = u, y = x, which in the step that goes beyond `at` returns another time than the step's end. */
#include <math.h>

#include "frame/unit.h"

typedef struct {
    double u, y, at;
} Returning;

static const Variable variables[] = {
    {"u", INPUT, REAL, offsetof(Returning, u), .start = 1},
    {"y", OUTPUT, REAL, offsetof(Returning, y)},
    {"at", PARAMETER, REAL, offsetof(Returning, at), .unit = "s", .start = 0.25},
};

static bool beyond(Unit *unit, double end) {
    SELF(Returning);
    return end > self->at * (1 + 1e-12);
}

static void advance(Unit *unit, double h) {
    SELF(Returning);
    self->y += h * self->u;
}

static enum status return_early(Unit *unit, double t, double h, StepEnd *end) {
    bool early = beyond(unit, t + h);
    if (early)
        *end = (StepEnd){.early = true, .last_time = t + h / 2};
    advance(unit, early ? h / 2 : h);
    return OK;
}
static enum status return_before_its_begin(Unit *unit, double t, double h, StepEnd *end) {
    if (beyond(unit, t + h))
        *end = (StepEnd){.early = true, .last_time = t - h};
    advance(unit, h);
    return OK;
}
static enum status return_beyond_its_end(Unit *unit, double t, double h, StepEnd *end) {
    if (beyond(unit, t + h))
        end->last_time = t + 2 * h;
    advance(unit, h);
    return OK;
}
static enum status return_no_number(Unit *unit, double t, double h, StepEnd *end) {
    if (beyond(unit, t + h))
        *end = (StepEnd){.early = true, .last_time = NAN};
    advance(unit, h);
    return OK;
}
/* allowed: steps of its own that end a little off, and an early return that is none */
static enum status return_nearly(Unit *unit, double t, double h, StepEnd *end) {
    if (beyond(unit, t + h)) {
        end->early = true;
        end->last_time = (t + h) * (1 - 1e-15);
    }
    advance(unit, h);
    return OK;
}

#define RETURNS(name, abilities, do_step)                                                                              \
    static const Model name = {                                                                                        \
        #name, variables, COUNT(variables), 0.1, abilities, sizeof(Returning), .step = do_step,                        \
    };                                                                                                                 \
    UNIT(name)
RETURNS(returns_early, 0, return_early)
RETURNS(returns_before, 0, return_before_its_begin)
RETURNS(returns_beyond, 0, return_beyond_its_end)
RETURNS(returns_no_number, 0, return_no_number)
RETURNS(returns_nearly, 0, return_nearly)
RETURNS(returns_before_in_events, EVENTS | EARLY_RETURN, return_before_its_begin)
RETURNS(returns_beyond_in_events, EVENTS | EARLY_RETURN, return_beyond_its_end)
