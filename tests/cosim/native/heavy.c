/* y = u + sin(...) of many numbers: a step that takes as long as `work` says, about 20 us for each. */
#include <math.h>

#include "frame/unit.h"

typedef struct {
    double u, y;
    int32_t work;
} Heavy;

static const Variable variables[] = {
    {"u", INPUT, REAL, offsetof(Heavy, u), .start = 1},
    {"y", OUTPUT, REAL, offsetof(Heavy, y)},
    {"work", PARAMETER, INTEGER, offsetof(Heavy, work), .start = 1},
};

static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Heavy);
    double sum = 0;
    for (int32_t i = 0; i < self->work * 1000; i++)
        sum += sin(self->u + i);
    self->y = self->u + 1e-9 * sum;
    return OK;
}

static const Model heavy = {"heavy", variables, COUNT(variables), 0.1, 0, sizeof(Heavy), NULL, NULL, NULL, step};
UNIT(heavy)
