/* y = k u + n, of units that lose the start values that they were given, or give back others. */
#include <math.h>

#include "frame/unit.h"

typedef struct {
    double k, u, y;
    int32_t n, on;
} Start;

static const Variable variables[] = {
    {"k", PARAMETER, REAL, offsetof(Start, k), .start = 1},
    {"n", PARAMETER, INTEGER, offsetof(Start, n), .start = 2},
    {"on", PARAMETER, BOOLEAN, offsetof(Start, on)},
    {"u", INPUT, REAL, offsetof(Start, u), .start = 3},
    {"y", OUTPUT, REAL, offsetof(Start, y), .depends = "u"},
};

static void multiply(Unit *unit) {
    SELF(Start);
    self->y = self->on ? self->k * self->u + self->n : 0;
}

/* Some exporters' units begin from their own start values in fmi2SetupExperiment, or as they are initialised. */
static void reset(Unit *unit) {
    SELF(Start);
    *self = (Start){.k = 1, .n = 2, .u = 3};
}

/* `k` and `n` are what they were compiled with, whenever they are set. */
static void multiply_by_constants(Unit *unit) {
    SELF(Start);
    self->k = 1;
    self->n = 2;
    multiply(unit);
}

static void multiply_in_single_precision(Unit *unit) {
    SELF(Start);
    self->k = (float)self->k;
    multiply(unit);
}

static void multiply_by_radians(Unit *unit) {
    SELF(Start);
    double radians = self->k * (3.141592653589793 / 180);
    self->k = radians / (3.141592653589793 / 180);
    multiply(unit);
}

#define LOSES(name, abilities, initialize, outputs)                                                                    \
    static const Model name = {                                                                                        \
        #name, variables, COUNT(variables), 0.1, abilities, sizeof(Start), NULL, initialize, outputs,                  \
    };                                                                                                                 \
    UNIT(name)
LOSES(resets, 0, reset, multiply)
LOSES(resets_in_secret, SECRET_PARAMETERS, reset, multiply)
LOSES(keeps_in_secret, SECRET_PARAMETERS, NULL, multiply)
LOSES(keeps_constants, 0, NULL, multiply_by_constants)
LOSES(keeps_single_precision, 0, NULL, multiply_in_single_precision)
LOSES(keeps_radians, 0, NULL, multiply_by_radians)
