/* Signals of time alone: sine, y = a sin(w t + phase) + b; ramp, y = slope t + b. */
#include <math.h>

#include "frame/unit.h"

typedef struct {
    double y, a, w, phase, b;
} Source;

static const Variable of_sine[] = {
    {"y", OUTPUT, REAL, offsetof(Source, y)},
    {"a", PARAMETER, REAL, offsetof(Source, a), .start = 1},
    {"w", PARAMETER, REAL, offsetof(Source, w), .start = 1, .unit = "rad/s"},
    {"phase", PARAMETER, REAL, offsetof(Source, phase), .unit = "rad"},
    {"b", PARAMETER, REAL, offsetof(Source, b)},
};
static const Variable of_ramp[] = {
    {"y", OUTPUT, REAL, offsetof(Source, y)},
    {"slope", PARAMETER, REAL, offsetof(Source, a), .start = 1},
    {"b", PARAMETER, REAL, offsetof(Source, b)},
};

static void sine_outputs(Unit *unit) {
    SELF(Source);
    self->y = self->a * sin(self->w * unit->kept->time + self->phase) + self->b;
}
static void ramp_outputs(Unit *unit) {
    SELF(Source);
    self->y = self->a * unit->kept->time + self->b;
}

static const Model sine = {"sine", of_sine, COUNT(of_sine), 0.1, 0, sizeof(Source), .outputs = sine_outputs};
static const Model ramp = {"ramp", of_ramp, COUNT(of_ramp), 0.1, 0, sizeof(Source), .outputs = ramp_outputs};
UNIT(sine)
UNIT(ramp)
