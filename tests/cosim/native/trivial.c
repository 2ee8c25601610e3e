/* y = u + 1, taken over by a step; as cheap as a unit can be. In a ring it is no algebraic loop. */
#include "frame/unit.h"

typedef struct {
    double u, y;
} Trivial;

static const Variable variables[] = {
    {"u", INPUT, REAL, offsetof(Trivial, u)},
    {"y", OUTPUT, REAL, offsetof(Trivial, y)},
};

static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Trivial);
    self->y = self->u + 1;
    return OK;
}

static const Model trivial = {"trivial", variables, COUNT(variables), 0.01, 0, sizeof(Trivial), .step = step};
UNIT(trivial)
