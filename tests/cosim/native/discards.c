/* x' = u, y = x, which takes no longer steps than `longest`.
 *
 * FMI 2: it goes as far as it can, discards the rest and tells the time it got to. FMI 3: it stays where it was. */
#include "frame/unit.h"

typedef struct {
    double u, y, longest;
} Discards;

static const Variable variables[] = {
    {"u", INPUT, REAL, offsetof(Discards, u), .start = 1},
    {"y", OUTPUT, REAL, offsetof(Discards, y)},
    {"longest", PARAMETER, REAL, offsetof(Discards, longest), .unit = "s", .start = 0.04},
};

static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Discards);
    bool too_long = h > self->longest * (1 + 1e-12);
    if (too_long)
        say(unit, DISCARD, "a step of %g s is longer than %g s", h, self->longest);
    double done = !too_long ? h : unit->fmi == 3 ? 0 : self->longest;
    end->last_time = t + done;
    self->y += done * self->u;
    return too_long ? DISCARD : OK;
}

static const Model discards = {"discards", variables, COUNT(variables), 0.1, 0, sizeof(Discards), .step = step};
UNIT(discards)
