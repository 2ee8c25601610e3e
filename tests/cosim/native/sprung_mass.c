/* A mass on a spring and a damper of its own, coupled by another spring and damper to an end that is moved.
 *
 * m x'' = -f - k x - d x', f = k_c (x - x1) + d_c (x' - v1): displacement-driven, f is the force on the moved end. With
 * `mass`, which takes f and gives x1 and v1, it makes the two-mass oscillator of [Busch2016], sec. 2.4. */
#include <math.h>

#include "frame/unit.h"

typedef struct {
    double x1, v1, f, x, v, m, k, d, k_c, d_c, x0, v0;
} SprungMass;

static const Variable variables[] = {
    {"x1", INPUT, REAL, offsetof(SprungMass, x1), .unit = "m"},
    {"v1", INPUT, REAL, offsetof(SprungMass, v1), .unit = "m/s"},
    {"f", OUTPUT, REAL, offsetof(SprungMass, f), .unit = "N", .depends = "x1 v1"},
    {"x", OUTPUT, REAL, offsetof(SprungMass, x), .unit = "m"},
    {"v", OUTPUT, REAL, offsetof(SprungMass, v), .unit = "m/s"},
    {"m", PARAMETER, REAL, offsetof(SprungMass, m), .unit = "kg", .start = 1},
    {"k", PARAMETER, REAL, offsetof(SprungMass, k), .unit = "N/m"},
    {"d", PARAMETER, REAL, offsetof(SprungMass, d), .unit = "N.s/m"},
    {"k_c", PARAMETER, REAL, offsetof(SprungMass, k_c), .unit = "N/m", .start = 1},
    {"d_c", PARAMETER, REAL, offsetof(SprungMass, d_c), .unit = "N.s/m"},
    {"x0", PARAMETER, REAL, offsetof(SprungMass, x0), .unit = "m"},
    {"v0", PARAMETER, REAL, offsetof(SprungMass, v0), .unit = "m/s"},
};

static void initialize(Unit *unit) {
    SELF(SprungMass);
    self->x = self->x0;
    self->v = self->v0;
}

static double force(Unit *unit, double since, double x, double v) {
    SELF(SprungMass);
    double x1 = input_at(unit, &self->x1, since), v1 = input_at(unit, &self->v1, since);
    return self->k_c * (x - x1) + self->d_c * (v - v1);
}

static double acceleration(Unit *unit, double since, double x, double v) {
    SELF(SprungMass);
    return (-force(unit, since, x, v) - self->k * x - self->d * v) / self->m;
}

/* At a communication point the end is where the input says. */
static void outputs(Unit *unit) {
    SELF(SprungMass);
    self->f = force(unit, 0, self->x, self->v);
}

static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    SELF(SprungMass);
    runge_kutta(unit, acceleration, h, &self->x, &self->v);
    self->x1 = input_at(unit, &self->x1, h); /* where the derivatives have led: the outputs follow at once */
    self->v1 = input_at(unit, &self->v1, h);
    return OK;
}

static const Model sprung_mass = {
    "sprung_mass", variables, COUNT(variables), 0.01, INTERPOLATES | DERIVATIVES, sizeof(SprungMass),
    NULL, initialize, outputs, step,
};
UNIT(sprung_mass)
