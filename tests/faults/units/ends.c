/* x' = u, y = x, which asks to end the simulation in the step that goes beyond `at`: at its end, or within it. */
#include "frame/unit.h"

typedef struct {
    double u, y, at;
} Ending;

static const Variable variables[] = {
    {"u", INPUT, REAL, offsetof(Ending, u), .start = 1},
    {"y", OUTPUT, REAL, offsetof(Ending, y)},
    {"at", PARAMETER, REAL, offsetof(Ending, at), .unit = "s", .start = 0.25},
};

/* FMI 2: a Discard whose `fmi2Terminated` is true; FMI 3: an early return, which is allowed for this. */
static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Ending);
    if (t + h > self->at * (1 + 1e-12))
        *end = (StepEnd){.terminate = true, .early = true, .last_time = self->at};
    self->y += (end->last_time - t) * self->u;
    return OK;
}

static const Model ends_within_step = {
    "ends_within_step", variables, COUNT(variables), 0.1, 0, sizeof(Ending), .step = step,
};
UNIT(ends_within_step)

/* FMI 3: an event at `at`, in which it asks for it */
static enum status step_to_event(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Ending);
    if (t + h > self->at * (1 + 1e-12))
        *end = (StepEnd){.event_needed = true, .early = true, .last_time = self->at};
    self->y += (end->last_time - t) * self->u;
    return OK;
}
static void end_at_event(Unit *unit, Update *update) {
    SELF(Ending);
    update->terminate = unit->kept->time >= self->at;
}
static const Model ends_at_event = {
    "ends_at_event", variables, COUNT(variables), 0.1, EVENTS | EARLY_RETURN, sizeof(Ending), .step = step_to_event,
    .update = end_at_event,
};
UNIT(ends_at_event)
