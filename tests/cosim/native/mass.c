/* m x'' = f - k x - d x': a mass on a spring and a damper of its own, driven by a force. An input that comes with time
 * derivatives is followed. */
#include "frame/unit.h"

typedef struct {
    double f, x, v, m, k, d, x0, v0;
} Mass;

static const Variable variables[] = {
    {"f", INPUT, REAL, offsetof(Mass, f), .unit = "N"},
    {"x", OUTPUT, REAL, offsetof(Mass, x), .unit = "m"},
    {"v", OUTPUT, REAL, offsetof(Mass, v), .unit = "m/s"},
    {"m", PARAMETER, REAL, offsetof(Mass, m), .unit = "kg", .start = 1},
    {"k", PARAMETER, REAL, offsetof(Mass, k), .unit = "N/m"},
    {"d", PARAMETER, REAL, offsetof(Mass, d), .unit = "N.s/m"},
    {"x0", PARAMETER, REAL, offsetof(Mass, x0), .unit = "m"},
    {"v0", PARAMETER, REAL, offsetof(Mass, v0), .unit = "m/s"},
};

static void initialize(Unit *unit) {
    SELF(Mass);
    self->x = self->x0;
    self->v = self->v0;
}

static double acceleration(Unit *unit, double since, double x, double v) {
    SELF(Mass);
    return (input_at(unit, &self->f, since) - self->k * x - self->d * v) / self->m;
}

static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Mass);
    runge_kutta(unit, acceleration, h, &self->x, &self->v);
    return OK;
}

static const Model mass = {
    "mass", variables, COUNT(variables), 0.01, INTERPOLATES | DERIVATIVES, sizeof(Mass), NULL, initialize, NULL, step,
};
UNIT(mass)
