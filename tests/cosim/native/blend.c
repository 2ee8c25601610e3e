/* y = (u1 + u2 + u3) / 4 + 1, at once (blend) or taken over by a step (late_blend): bounded in networks of any size. */
#include "frame/unit.h"

typedef struct {
    double u1, u2, u3, y;
} Blend;

static const Variable at_once[] = {
    {"u1", INPUT, REAL, offsetof(Blend, u1)},
    {"u2", INPUT, REAL, offsetof(Blend, u2)},
    {"u3", INPUT, REAL, offsetof(Blend, u3)},
    {"y", OUTPUT, REAL, offsetof(Blend, y), .depends = "u1 u2 u3"},
};
static const Variable later[] = {
    {"u1", INPUT, REAL, offsetof(Blend, u1)},
    {"u2", INPUT, REAL, offsetof(Blend, u2)},
    {"u3", INPUT, REAL, offsetof(Blend, u3)},
    {"y", OUTPUT, REAL, offsetof(Blend, y)},
};

static void outputs(Unit *unit) {
    SELF(Blend);
    self->y = (self->u1 + self->u2 + self->u3) / 4 + 1;
}

static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    outputs(unit);
    return OK;
}

static const Model blend = {"blend", at_once, COUNT(at_once), 0.01, 0, sizeof(Blend), .outputs = outputs};
static const Model late_blend = {"late_blend", later, COUNT(later), 0.01, 0, sizeof(Blend), .step = step};
UNIT(blend)
UNIT(late_blend)
