/* Units that answer discrete inputs in Event Mode.
 *
 * follower: count = count_in + 1, at most `most`, in the iteration after the one in which count_in came. watch: tells
 * when its input changed last. asker: asks for one more iteration for ever. staller: from 0.2 s on returns at once,
 * without getting on, as often as `most` says. pending: goes on by itself, as FMI 2 allows. */
#include "frame/unit.h"

typedef struct {
    int32_t count_in, count, most;
} Follower;

typedef struct {
    double changed;
    int32_t count_in, count, changes;
} Watch;

static const Variable of_follower[] = {
    {"count_in", INPUT, INTEGER, offsetof(Follower, count_in)},
    {"count", OUTPUT, INTEGER, offsetof(Follower, count)},
    {"most", PARAMETER, INTEGER, offsetof(Follower, most), .start = 7},
};
static const Variable of_watch[] = {
    {"count_in", INPUT, INTEGER, offsetof(Watch, count_in)},
    {"count", OUTPUT, INTEGER, offsetof(Watch, count)},
    {"changes", OUTPUT, INTEGER, offsetof(Watch, changes)},
    {"changed", OUTPUT, REAL, offsetof(Watch, changed), .unit = "s", .discrete = true},
};

static void follow(Unit *unit, Update *update) {
    SELF(Follower);
    self->count = self->count_in < self->most ? self->count_in + 1 : self->most;
}
static void note(Unit *unit, Update *update) {
    SELF(Watch);
    if (self->count != self->count_in) {
        self->changed = unit->kept->time;
        self->changes++;
    }
    self->count = self->count_in;
}
static void ask(Unit *unit, Update *update) { update->again = unit->kept->time > 0; }
static enum status ask_at_end(Unit *unit, double t, double h, StepEnd *end) {
    end->event_needed = true;
    return OK;
}

static enum status stall(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Follower);
    if (t < 0.2 - 1e-9 || self->count >= self->most)
        return OK;
    end->early = end->event_needed = true;
    end->last_time = t;
    return OK;
}
static void count_stall(Unit *unit, Update *update) {
    SELF(Follower);
    self->count += unit->kept->time > 0;
}
static enum status postpone(Unit *unit, double t, double h, StepEnd *end) {
    return t < 0.15 ? OK : (enum status)5;
}

static const Model follower = {
    "follower", of_follower, COUNT(of_follower), 0.1, EVENTS, sizeof(Follower), .update = follow,
};
static const Model watch = {"watch", of_watch, COUNT(of_watch), 0.1, EVENTS, sizeof(Watch), .update = note};
static const Model asker = {
    "asker", of_watch, COUNT(of_watch), 0.1, EVENTS, sizeof(Watch), .step = ask_at_end, .update = ask,
};
static const Model staller = {
    "staller", of_follower, COUNT(of_follower), 0.1, EVENTS | EARLY_RETURN, sizeof(Follower),
    .step = stall, .update = count_stall,
};
static const Model pending = {"pending", of_watch, COUNT(of_watch), 0.1, 0, sizeof(Watch), .step = postpone};
UNIT(follower)
UNIT(watch)
UNIT(asker)
UNIT(staller)
UNIT(pending)
