/* y = a u + b, y = a1 u1 + a2 u2 + b, and y1 = a1 u1, y2 = a2 u2: direct feedthrough, for algebraic loops and chains.
 *
 * mixed_gain: y = a u + b, n = m and is = was, which FMI 2 tells apart by their types alone. */
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

typedef struct {
    double u1, u2, y1, y2, a1, a2;
} TwoGains;

static const Variable apart[] = {
    {"u1", INPUT, REAL, offsetof(TwoGains, u1)},
    {"u2", INPUT, REAL, offsetof(TwoGains, u2)},
    {"y1", OUTPUT, REAL, offsetof(TwoGains, y1), .depends = "u1"},
    {"y2", OUTPUT, REAL, offsetof(TwoGains, y2), .depends = "u2"},
    {"a1", PARAMETER, REAL, offsetof(TwoGains, a1), .start = 1},
    {"a2", PARAMETER, REAL, offsetof(TwoGains, a2), .start = 1},
};

typedef struct {
    double u, y, a, b;
    int32_t m, n, was, is;
} MixedGain;

static const Variable mixed[] = {
    {"u", INPUT, REAL, offsetof(MixedGain, u)},
    {"y", OUTPUT, REAL, offsetof(MixedGain, y), .depends = "u"},
    {"a", PARAMETER, REAL, offsetof(MixedGain, a), .start = 1},
    {"b", PARAMETER, REAL, offsetof(MixedGain, b)},
    {"m", INPUT, INTEGER, offsetof(MixedGain, m)},
    {"n", OUTPUT, INTEGER, offsetof(MixedGain, n), .depends = "m"},
    {"was", INPUT, BOOLEAN, offsetof(MixedGain, was)},
    {"is", OUTPUT, BOOLEAN, offsetof(MixedGain, is), .depends = "was"},
};

static void outputs_mixed(Unit *unit) {
    SELF(MixedGain);
    self->y = self->a * self->u + self->b;
    self->n = self->m;
    self->is = self->was;
}

static void outputs_apart(Unit *unit) {
    SELF(TwoGains);
    self->y1 = self->a1 * self->u1;
    self->y2 = self->a2 * self->u2;
}

static void outputs(Unit *unit) {
    SELF(Gain);
    self->y = self->a1 * self->u1 + self->a2 * self->u2 + self->b;
}

static const Model gain = {"gain", one, COUNT(one), 0.1, DERIVATIVES, sizeof(Gain), .outputs = outputs};
static const Model sum = {"sum", two, COUNT(two), 0.1, DERIVATIVES, sizeof(Gain), .outputs = outputs};
UNIT(gain)
UNIT(sum)

static const Model tuned_gain = {
    "tuned_gain", one, COUNT(one), 0.1, TUNABLE_PARAMETERS, sizeof(Gain), .outputs = outputs,
};
UNIT(tuned_gain)
static const Model two_gains = {
    "two_gains", apart, COUNT(apart), 0.1, DERIVATIVES, sizeof(TwoGains), .outputs = outputs_apart,
};
UNIT(two_gains)
static const Model mixed_gain = {
    "mixed_gain", mixed, COUNT(mixed), 0.1, 0, sizeof(MixedGain), .outputs = outputs_mixed,
};
UNIT(mixed_gain)
