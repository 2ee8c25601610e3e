/* A sampled block's ticks: at start + k * period, k = 0, 1, 2, ...
 *
 * Without event mode a step runs the ticks in [t, t + dt) by itself. With event mode the host activates the clock at each
 * tick, and steps only pass the time between. Some hosts use event mode wherever it is offered, but do not support
 * clocks: when one leaves out the first tick, the unit ticks by itself, after a warning. Either way the block is stepped
 * by its period with the inputs as they are at the tick, and its outputs hold until the next one.
 */
#include <math.h>

#include "log.h"
#include "sampling.h"
#include "slave.h"
#include "variables.h"

#define MOST_TICKS 1e9 /* in a step; they would take hours */
#define STEP_TOLERANCE 1e-6 /* relative: hosts write step sizes as decimals, and add them up */

double period(const Instance *instance) {
    return (double)instance->period_counter / (double)instance->period_resolution;
}

/* Both the product and the quotient are rounded once at most, however many ticks there were. */
static double next_tick(const Instance *instance) {
    double passed = (double)(instance->events.ticks * instance->period_counter);
    return instance->events.start + passed / (double)instance->period_resolution;
}

/* How far the host's time of the next tick may be off: what a step size that is off makes in all steps since the start,
 * but so little of a step that no tick comes a step late. */
static double tick_tolerance(const Instance *instance, double dt) {
    double passed = next_tick(instance) - instance->events.start + period(instance);
    return fmin(STEP_TOLERANCE * passed, dt / 4.0);
}

/* The block is given the tick's own time, not the host's, which may be off by rounding: a run is then the same in all
 * hosts, with event mode and without. */
static void set_clock(Instance *instance) {
    instance->floats[0] = next_tick(instance);
    instance->floats[1] = period(instance);
}

static Status tick(Instance *instance, const char *function) {
    double t = instance->floats[0];
    set_clock(instance);
    Status status = slave_step(instance, function);
    instance->floats[0] = t;
    if (status == STATUS_OK) instance->events.ticks++;
    return status;
}

/* A step size that is wrong, perhaps by its unit, would block the host for hours. */
static bool too_many_ticks(const Instance *instance, double t, double dt) {
    return (t + dt - next_tick(instance)) / period(instance) > MOST_TICKS;
}

static Status tick_by_itself(Instance *instance, const char *function, double t, double dt) {
    if (too_many_ticks(instance, t, dt))
        return refuse(instance, function, "a step of %.17g s holds more than %g ticks of the unit, one each %.17g s", dt,
                      MOST_TICKS, period(instance));
    bool ticked = false;
    while (next_tick(instance) < t + dt - tick_tolerance(instance, dt)) {
        if (tick(instance, function) != STATUS_OK) {
            if (ticked) instance->mode = FAILED; /* the state has changed, although the exception says it has not */
            return STATUS_ERROR;
        }
        ticked = true;
    }
    instance->floats[0] = t + dt;
    return ticked ? check_outputs(instance, function) : STATUS_OK;
}

static Status miss_tick(Instance *instance, const char *function, double t, double dt) {
    double due = next_tick(instance);
    if (instance->events.clock_used)
        return refuse(instance, function,
                      "the clock ticks at t = %.17g s, which is within this step from %.17g s to %.17g s: end a step "
                      "there, and activate the clock in event mode with fmi3SetClock",
                      due, t, t + dt);
    warn(instance, function,
         "event mode is used, but the clock was not activated with fmi3SetClock at its tick at t = %.17g s: the unit "
         "ticks by itself, until the clock is activated",
         due);
    instance->events.ticks_alone = true;
    return tick_by_itself(instance, function, t, dt);
}

static Status hold_until_tick(Instance *instance, const char *function, double t, double dt, StepEnd *end) {
    double due = next_tick(instance), tolerance = tick_tolerance(instance, dt);
    if (!(due < t + dt - tolerance)) {
        instance->floats[0] = t + dt;
        end->event_needed = due <= t + dt + tolerance;
        return STATUS_OK;
    }
    bool now = due <= t + tolerance;
    if (!instance->early_return_allowed || (now && instance->events.tick_told))
        return miss_tick(instance, function, t, dt);
    instance->floats[0] = now ? t : due;
    instance->events.tick_told = true;
    end->early = end->event_needed = true;
    return STATUS_OK;
}

Status sampling_step(Instance *instance, const char *function, double t, double dt, StepEnd *end) {
    if (instance->event_mode_used && !instance->events.ticks_alone)
        return hold_until_tick(instance, function, t, dt, end);
    return tick_by_itself(instance, function, t, dt);
}

Status sampling_activate(Instance *instance, const char *function) {
    if (instance->events.clock_active) return STATUS_OK;
    double due = next_tick(instance), t = instance->floats[0];
    if (!(fabs(due - t) <= tick_tolerance(instance, period(instance))))
        return refuse(instance, function, "the clock ticks next at t = %.17g s; the instance is at %.17g s", due, t);
    instance->events.clock_active = instance->events.clock_used = true;
    instance->events.ticks_alone = false;
    instance->outputs_stale = true;
    return STATUS_OK;
}

/* For hosts that read the outputs of an active clock, and perhaps set inputs after that, before they settle the tick. */
Status sampling_evaluate(Instance *instance, const char *function) {
    if (!inputs_finite(instance, function)) return STATUS_ERROR;
    double t = instance->floats[0];
    set_clock(instance);
    Status status = slave_call(instance, function, "evaluate");
    instance->floats[0] = t;
    if (status != STATUS_OK) return STATUS_ERROR;
    instance->events.evaluated = true;
    instance->outputs_stale = false;
    return check_outputs(instance, function);
}

Status sampling_settle(Instance *instance, const char *function) {
    if (!inputs_finite(instance, function)) return STATUS_ERROR;
    if (!instance->events.evaluated) {
        if (tick(instance, function) != STATUS_OK) return STATUS_ERROR;
    } else {
        if (instance->outputs_stale && sampling_evaluate(instance, function) != STATUS_OK) return STATUS_ERROR;
        if (slave_call(instance, function, "settle") != STATUS_OK) return STATUS_ERROR;
        instance->events.ticks++;
    }
    instance->events.clock_active = instance->events.evaluated = instance->events.tick_told = false;
    instance->outputs_stale = false;
    return check_outputs(instance, function);
}
