/* y = a u + b, and y = a1 u1 + a2 u2 + b: direct feedthrough, for algebraic loops and chains. */
#include "frame/unit.h"

typedef struct {
    double u1, u2, y, a1, a2, b;
} Gain;

static const Variable one[] = {
    {"u", INPUT, REAL, offsetof(Gain, u1)},
    {"y", OUTPUT, REAL, offsetof(Gain, y), .depends = "u"},
    {"a", PARAMETER, REAL, offsetof(Gain, a1), .start = 1},
    {"b", PARAMETER, REAL, offsetof(Gain, b)},
};
static const Variable two[] = {
    {"u1", INPUT, REAL, offsetof(Gain, u1)},
    {"u2", INPUT, REAL, offsetof(Gain, u2)},
    {"y", OUTPUT, REAL, offsetof(Gain, y), .depends = "u1 u2"},
    {"a1", PARAMETER, REAL, offsetof(Gain, a1), .start = 1},
    {"a2", PARAMETER, REAL, offsetof(Gain, a2), .start = 1},
    {"b", PARAMETER, REAL, offsetof(Gain, b)},
};

static void outputs(Unit *unit) {
    SELF(Gain);
    self->y = self->a1 * self->u1 + self->a2 * self->u2 + self->b;
}

static const Model gain = {"gain", one, COUNT(one), 0.1, DERIVATIVES, sizeof(Gain), .outputs = outputs};
static const Model sum = {"sum", two, COUNT(two), 0.1, DERIVATIVES, sizeof(Gain), .outputs = outputs};
UNIT(gain)
UNIT(sum)
