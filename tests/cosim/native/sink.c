/* Takes u and gives nothing. */
#include "frame/unit.h"

typedef struct {
    double u;
} Sink;

static const Variable variables[] = {{"u", INPUT, REAL, offsetof(Sink, u)}};

static enum status step(Unit *unit, double t, double h, StepEnd *end) { return OK; }

static const Model sink = {"sink", variables, COUNT(variables), 0.1, 0, sizeof(Sink), .step = step};
UNIT(sink)
