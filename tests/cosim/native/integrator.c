/* x' = u, exact for an input that is held. */
#include "frame/unit.h"

typedef struct {
    double u, x, x0;
} Integrator;

static const Variable variables[] = {
    {"u", INPUT, REAL, offsetof(Integrator, u), .unit = "m/s"},
    {"x", OUTPUT, REAL, offsetof(Integrator, x), .unit = "m"},
    {"x0", PARAMETER, REAL, offsetof(Integrator, x0), .unit = "m"},
};

static void initialize(Unit *unit) {
    SELF(Integrator);
    self->x = self->x0;
}

static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Integrator);
    self->x += h * self->u;
    return OK;
}

static const Model integrator = {
    "integrator", variables, COUNT(variables), 0.1, DERIVATIVES, sizeof(Integrator), NULL, initialize, NULL, step,
};
UNIT(integrator)
