/* A spring and a damper between two ends: the force on each, f1 = k (x2 - x1) + d (v2 - v1) = -f2, at once. */
#include "frame/unit.h"

typedef struct {
    double x1, v1, x2, v2, f1, f2, k, d;
} Spring;

#define ENDS "x1 v1 x2 v2"
static const Variable variables[] = {
    {"x1", INPUT, REAL, offsetof(Spring, x1), .unit = "m"},
    {"v1", INPUT, REAL, offsetof(Spring, v1), .unit = "m/s"},
    {"x2", INPUT, REAL, offsetof(Spring, x2), .unit = "m"},
    {"v2", INPUT, REAL, offsetof(Spring, v2), .unit = "m/s"},
    {"f1", OUTPUT, REAL, offsetof(Spring, f1), .unit = "N", .depends = ENDS},
    {"f2", OUTPUT, REAL, offsetof(Spring, f2), .unit = "N", .depends = ENDS},
    {"k", PARAMETER, REAL, offsetof(Spring, k), .unit = "N/m", .start = 1},
    {"d", PARAMETER, REAL, offsetof(Spring, d), .unit = "N.s/m"},
};

static void outputs(Unit *unit) {
    SELF(Spring);
    self->f1 = self->k * (self->x2 - self->x1) + self->d * (self->v2 - self->v1);
    self->f2 = -self->f1;
}

static const Model spring = {
    "spring", variables, COUNT(variables), 0.01, DERIVATIVES, sizeof(Spring), .outputs = outputs,
};
UNIT(spring)
