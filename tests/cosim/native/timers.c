/* Two units with aperiodic Clocks, and one whose Clock's interval depends on a parameter.
 *
 * pulses: the k-th tick comes k * 0.1 s after the one before. alarm: rings `delay` after its discrete input changed.
 * metronome: ticks every `beat` s. */
#include "frame/unit.h"

enum { NOT_YET_KNOWN, UNCHANGED, CHANGED };

typedef struct {
    double beat;
    int32_t tick, count, before;
} Pulses;

typedef struct {
    double delay;
    int32_t ring, wish, last_wish, waiting, sent, rings;
} Alarm;

static const Variable of_pulses[] = {
    {"tick", INPUT, CLOCK, offsetof(Pulses, tick), .timing = "changing"},
    {"count", OUTPUT, INTEGER, offsetof(Pulses, count), .clock = "tick"},
};
static const Variable of_metronome[] = {
    {"tick", INPUT, CLOCK, offsetof(Pulses, tick), .timing = "fixed"},
    {"count", OUTPUT, INTEGER, offsetof(Pulses, count), .clock = "tick"},
    {"beat", PARAMETER, REAL, offsetof(Pulses, beat), .start = 0.1, .unit = "s"},
};
static const Variable of_alarm[] = {
    {"ring", INPUT, CLOCK, offsetof(Alarm, ring), .timing = "countdown"},
    {"wish", INPUT, INTEGER, offsetof(Alarm, wish)},
    {"rings", OUTPUT, INTEGER, offsetof(Alarm, rings)},
    {"delay", PARAMETER, REAL, offsetof(Alarm, delay), .start = 0.25, .unit = "s"},
};

static void count(Unit *unit) {
    SELF(Pulses);
    if (self->tick)
        self->count = self->before + 1;
}
static void keep_count(Unit *unit, Update *update) {
    SELF(Pulses);
    self->before = self->count;
}
static int longer(Unit *unit, double *interval) {
    SELF(Pulses);
    *interval = 0.1 * (self->count + 1);
    return CHANGED;
}
static int beat(Unit *unit, double *interval) {
    SELF(Pulses);
    *interval = self->beat;
    return unit->kept->mode == INITIALIZATION ? CHANGED : UNCHANGED;
}

static void watch(Unit *unit, Update *update) {
    SELF(Alarm);
    if (self->ring) {
        self->rings++;
        self->waiting = false;
    }
    if (self->wish != self->last_wish)
        self->waiting = true, self->sent = false;
    self->last_wish = self->wish;
}
static int remaining(Unit *unit, double *interval) {
    SELF(Alarm);
    *interval = self->delay;
    if (!self->waiting)
        return NOT_YET_KNOWN;
    int qualifier = self->sent ? UNCHANGED : CHANGED;
    self->sent = true;
    return qualifier;
}

static const Model pulses = {
    "pulses", of_pulses, COUNT(of_pulses), 0.1, EVENTS, sizeof(Pulses),
    .outputs = count, .update = keep_count, .interval = longer,
};
static const Model metronome = {
    "metronome", of_metronome, COUNT(of_metronome), 0.1, EVENTS, sizeof(Pulses),
    .outputs = count, .update = keep_count, .interval = beat,
};
static const Model alarm_clock = {
    "alarm", of_alarm, COUNT(of_alarm), 0.1, EVENTS, sizeof(Alarm), .update = watch, .interval = remaining,
};
UNIT(pulses)
UNIT(metronome)
UNIT(alarm_clock)
