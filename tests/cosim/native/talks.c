/* y = u, and each step writes so many lines to the log. */
#include "frame/unit.h"

typedef struct {
    double u, y;
    int32_t lines;
} Talking;

static const Variable variables[] = {
    {"u", INPUT, REAL, offsetof(Talking, u), .start = 1},
    {"y", OUTPUT, REAL, offsetof(Talking, y)},
    {"lines", PARAMETER, INTEGER, offsetof(Talking, lines), .start = 1},
};

static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Talking);
    self->y = self->u;
    for (int32_t i = 1; i <= self->lines; i++)
        say(unit, WARNING, "line %d of %d of the step from t = %g s", i, self->lines, t);
    return OK;
}

static const Model talks = {"talks", variables, COUNT(variables), 0.1, 0, sizeof(Talking), NULL, NULL, NULL, step};
UNIT(talks)
