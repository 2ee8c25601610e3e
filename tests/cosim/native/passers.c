/* y = u at once, for an array, bytes, an integer and a truth value; FMI 3 alone has the first two.
 *
 * bytes_keeper: y = u too, but at events, as u is discrete. */
#include "frame/unit.h"

typedef struct {
    double u[3], y[3];
} ArrayPasser;
typedef struct {
    Bytes u, y;
} BinaryPasser;
typedef struct {
    int32_t count_in, count, truth_in, truth;
} DiscretePasser;

static const Variable of_arrays[] = {
    {"u", INPUT, REAL, offsetof(ArrayPasser, u), .length = 3, .unit = "m"},
    {"y", OUTPUT, REAL, offsetof(ArrayPasser, y), .length = 3, .unit = "m", .depends = "u"},
};
static const Variable of_bytes[] = {
    {"u", INPUT, BINARY, offsetof(BinaryPasser, u)},
    {"y", OUTPUT, BINARY, offsetof(BinaryPasser, y), .depends = "u"},
};
static const Variable discrete[] = {
    {"count_in", INPUT, INTEGER, offsetof(DiscretePasser, count_in)},
    {"count", OUTPUT, INTEGER, offsetof(DiscretePasser, count), .depends = "count_in"},
    {"truth_in", INPUT, BOOLEAN, offsetof(DiscretePasser, truth_in)},
    {"truth", OUTPUT, BOOLEAN, offsetof(DiscretePasser, truth), .depends = "truth_in"},
};

static const Variable kept_bytes[] = {
    {"u", INPUT, BINARY, offsetof(BinaryPasser, u)},
    {"y", OUTPUT, BINARY, offsetof(BinaryPasser, y)},
};

static void pass_array(Unit *unit) {
    SELF(ArrayPasser);
    for (int i = 0; i < 3; i++)
        self->y[i] = self->u[i];
}
static void pass_bytes(Unit *unit) {
    SELF(BinaryPasser);
    self->y = self->u;
}
static void pass_discrete(Unit *unit) {
    SELF(DiscretePasser);
    self->count = self->count_in;
    self->truth = self->truth_in;
}

static void keep_bytes(Unit *unit, Update *update) {
    SELF(BinaryPasser);
    self->y = self->u;
}

static const Model array_passer = {
    "array_passer", of_arrays, COUNT(of_arrays), 0.1, 0, sizeof(ArrayPasser), .outputs = pass_array,
};
static const Model binary_passer = {
    "binary_passer", of_bytes, COUNT(of_bytes), 0.1, 0, sizeof(BinaryPasser), .outputs = pass_bytes,
};
static const Model discrete_passer = {
    "discrete_passer", discrete, COUNT(discrete), 0.1, 0, sizeof(DiscretePasser), .outputs = pass_discrete,
};
static const Model bytes_keeper = {
    "bytes_keeper", kept_bytes, COUNT(kept_bytes), 0.1, EVENTS, sizeof(BinaryPasser), .update = keep_bytes,
};
UNIT(array_passer)
UNIT(binary_passer)
UNIT(discrete_passer)
UNIT(bytes_keeper)
