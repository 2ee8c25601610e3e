/* A ball falls, h'' = -g, and bounces, v = -e v, exactly; slower than v_rest it stays on the floor.
 *
 * With Event Mode an impact is an event: a step returns early at it where it may, and else goes through it. With
 * `announces`, Event Mode tells the next impact's time. Without Event Mode the ball bounces within its steps. */
#include <math.h>

#include "frame/unit.h"

typedef struct {
    double h, v, g, e, h0, v0, v_rest;
    int32_t announces, bounces, at_impact, rests;
} Ball;

static const Variable variables[] = {
    {"h", OUTPUT, REAL, offsetof(Ball, h), .unit = "m"},
    {"v", OUTPUT, REAL, offsetof(Ball, v), .unit = "m/s"},
    {"bounces", OUTPUT, INTEGER, offsetof(Ball, bounces)},
    {"g", PARAMETER, REAL, offsetof(Ball, g), .unit = "m/s2", .start = 9.81},
    {"e", PARAMETER, REAL, offsetof(Ball, e), .start = 0.7},
    {"h0", PARAMETER, REAL, offsetof(Ball, h0), .unit = "m", .start = 1},
    {"v0", PARAMETER, REAL, offsetof(Ball, v0), .unit = "m/s"},
    {"v_rest", PARAMETER, REAL, offsetof(Ball, v_rest), .unit = "m/s", .start = 0.1},
    {"announces", PARAMETER, BOOLEAN, offsetof(Ball, announces)},
};

static void initialize(Unit *unit) {
    SELF(Ball);
    self->h = self->h0;
    self->v = self->v0;
}

static double time_to_impact(const Ball *self) {
    return self->rests ? INFINITY : (self->v + sqrt(self->v * self->v + 2 * self->g * self->h)) / self->g;
}

static void fall(Ball *self, double dt) {
    if (self->rests)
        return;
    self->h = fmax(0, self->h + dt * (self->v - dt * self->g / 2));
    self->v -= dt * self->g;
}

static void bounce(Ball *self) {
    self->bounces++;
    self->h = 0;
    self->v = -self->e * self->v;
    if (self->v < self->v_rest) {
        self->rests = true;
        self->v = 0;
    }
    self->at_impact = false;
}

static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Ball);
    double left = h, impact = time_to_impact(self);
    if (self->at_impact) { /* nobody entered Event Mode */
        bounce(self);
        impact = time_to_impact(self);
    }
    for (; impact <= left * (1 + 1e-12); impact = time_to_impact(self)) {
        bool at_end = impact >= left * (1 - 1e-12);
        fall(self, impact);
        left -= impact;
        if (unit->event_mode && (at_end || unit->early_return)) {
            self->h = 0;
            self->at_impact = end->event_needed = true;
            end->early = !at_end;
            end->last_time = at_end ? t + h : t + h - left;
            return OK;
        }
        bounce(self);
    }
    fall(self, left);
    return OK;
}

static void update(Unit *unit, Update *update) {
    SELF(Ball);
    if (self->at_impact)
        bounce(self);
    update->next = unit->kept->time + time_to_impact(self);
    update->next_defined = self->announces && isfinite(update->next);
}

static const Model ball = {
    "ball", variables, COUNT(variables), 0.01, EVENTS | EARLY_RETURN, sizeof(Ball), NULL, initialize, NULL, step, update,
};
UNIT(ball)
