/* m x'' = f - k x - d x': a mass on a spring and a damper of its own, driven by a force.
 *
 * Runge-Kutta of fourth order with steps of at most 1 ms. An input that comes with time derivatives is followed. */
#include <math.h>

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
    int n = (int)fmax(1, ceil(h / 1e-3 - 1e-6));
    double dt = h / n;
    for (int i = 0; i < n; i++) {
        double s = i * dt, x = self->x, v = self->v;
        double a1 = acceleration(unit, s, x, v), v1 = v;
        double v2 = v + dt / 2 * a1, a2 = acceleration(unit, s + dt / 2, x + dt / 2 * v1, v2);
        double v3 = v + dt / 2 * a2, a3 = acceleration(unit, s + dt / 2, x + dt / 2 * v2, v3);
        double v4 = v + dt * a3, a4 = acceleration(unit, s + dt, x + dt * v3, v4);
        self->x += dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
        self->v += dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
    return OK;
}

static const Model mass = {
    "mass", variables, COUNT(variables), 0.01, INTERPOLATES | DERIVATIVES, sizeof(Mass), NULL, initialize, NULL, step,
};
UNIT(mass)
