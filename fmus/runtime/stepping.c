/* How an instance advances in time: steps, and event mode between them. A block may have events of its own
 * (cosim/blocks/block.py); what a sampled block does in a step, and at its ticks, is in sampling.c. */
#include <math.h>

#include "log.h"
#include "sampling.h"
#include "slave.h"
#include "stepping.h"
#include "variables.h"

#define TIME_TOLERANCE 1e-9 /* of the time, or of 1 s: rounding errors of a host that adds up step sizes */

static double time_tolerance(const Instance *instance) {
    return TIME_TOLERANCE * fmax(1.0, fabs(instance->floats[0]));
}

static Status plain_step(Instance *instance, const char *function, double t, double dt) {
    double before = instance->floats[0], dt_before = instance->floats[1];
    instance->floats[0] = t;
    instance->floats[1] = dt;
    if (slave_step(instance, function) != STATUS_OK) {
        instance->floats[0] = before;
        instance->floats[1] = dt_before;
        return STATUS_ERROR;
    }
    instance->floats[0] = t + dt;
    return check_outputs(instance, function);
}

/* The time of the block's next time event; infinity if there is none. */
static Status ask_next_event(Instance *instance, const char *function, double *next) {
    if (slave_call(instance, function, "next_event") != STATUS_OK) return STATUS_ERROR;
    *next = instance->floats[1];
    return STATUS_OK;
}

/* If it may not return early, the block handles what happens within the step by itself; only an event at the step's
 * end is left to the host. */
static Status step_to_event(Instance *instance, const char *function, double t, double dt, StepEnd *end) {
    if (instance->events.event_pending)
        return refuse(instance, function,
                      "the event at t = %.17g s is not handled yet: call fmi3EnterEventMode and "
                      "fmi3UpdateDiscreteStates",
                      instance->floats[0]);
    if (!instance->early_return_allowed) {
        if (plain_step(instance, function, t, dt) != STATUS_OK) return STATUS_ERROR;
    } else {
        double before = instance->floats[0];
        instance->floats[0] = t;
        instance->floats[1] = dt;
        if (slave_call(instance, function, "advance") != STATUS_OK) {
            instance->floats[0] = before;
            return STATUS_ERROR;
        }
        end->early = instance->floats[1] < dt;
        instance->floats[0] = t + instance->floats[1];
        if (check_outputs(instance, function) != STATUS_OK) return STATUS_ERROR;
    }
    double next;
    if (ask_next_event(instance, function, &next) != STATUS_OK) return STATUS_ERROR;
    end->event_needed = end->early || next <= instance->floats[0] + time_tolerance(instance);
    instance->events.event_pending = end->event_needed;
    return STATUS_OK;
}

Status instance_step(Instance *instance, const char *function, double t, double dt, StepEnd *end) {
    double tolerance = time_tolerance(instance);
    if (!(fabs(t - instance->floats[0]) <= tolerance))
        return refuse(instance, function, "the step begins at t = %.17g s where the instance is at %.17g s", t,
                      instance->floats[0]);
    if (!(dt > 0.0 && isfinite(t + dt)))
        return refuse(instance, function, "the step size is %.17g s; it must be positive, and the step's end finite",
                      dt);
    if (t + dt > instance->stop_time + tolerance)
        return refuse(instance, function, "the step ends at t = %.17g s, after the stop time %.17g s", t + dt,
                      instance->stop_time);
    if (!inputs_finite(instance, function)) return STATUS_ERROR;
    *end = (StepEnd){false, false};
    if (is_sampled(instance)) return sampling_step(instance, function, t, dt, end);
    if (instance->event_mode_used && has_events(instance)) return step_to_event(instance, function, t, dt, end);
    return plain_step(instance, function, t, dt);
}

Status events_enter(Instance *instance, const char *function) {
    if (!instance->event_mode_used)
        return refuse(instance, function, "the instance was made with eventModeUsed = fmi3False");
    instance->mode = EVENT;
    return STATUS_OK;
}

Status events_leave(Instance *instance, const char *function) {
    if (instance->events.clock_active || instance->events.event_pending)
        return refuse(instance, function, "%s at t = %.17g s is not handled yet: call fmi3UpdateDiscreteStates before",
                      instance->events.clock_active ? "the clock's tick" : "the event", instance->floats[0]);
    instance->mode = STEPPING;
    return STATUS_OK;
}

static Status handle_event(Instance *instance, const char *function) {
    if (!inputs_finite(instance, function)) return STATUS_ERROR;
    if (slave_call(instance, function, "handle_event") != STATUS_OK) return STATUS_ERROR;
    instance->events.event_pending = false;
    return check_outputs(instance, function);
}

Status events_update(Instance *instance, const char *function, double *next) {
    *next = INFINITY;
    if (instance->events.clock_active && sampling_settle(instance, function) != STATUS_OK) return STATUS_ERROR;
    if (!has_events(instance)) return STATUS_OK;
    if (ask_next_event(instance, function, next) != STATUS_OK) return STATUS_ERROR;
    if (!instance->events.event_pending && *next > instance->floats[0] + time_tolerance(instance)) return STATUS_OK;
    if (handle_event(instance, function) != STATUS_OK) return STATUS_ERROR;
    return ask_next_event(instance, function, next);
}
