/* y = u1 + ... + u5 + 1, taken over by a step: a unit with many connections. */
#include "frame/unit.h"

typedef struct {
    double u[5], y;
} Hub;

static const Variable variables[] = {
    {"u1", INPUT, REAL, offsetof(Hub, u[0])}, {"u2", INPUT, REAL, offsetof(Hub, u[1])},
    {"u3", INPUT, REAL, offsetof(Hub, u[2])}, {"u4", INPUT, REAL, offsetof(Hub, u[3])},
    {"u5", INPUT, REAL, offsetof(Hub, u[4])}, {"y", OUTPUT, REAL, offsetof(Hub, y)},
};

static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Hub);
    self->y = 1;
    for (int i = 0; i < 5; i++)
        self->y += self->u[i];
    return OK;
}

static const Model hub = {"hub", variables, COUNT(variables), 0.01, 0, sizeof(Hub), .step = step};
UNIT(hub)
