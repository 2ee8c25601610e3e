/* Event mode, and blocks with events of their own (cosim/eventful_block.py). */
#include <math.h>

#include "instance.h"

/* When the block will have an event that is known beforehand; infinity if none. */
static Status ask_next_event(Instance *instance, const char *function, double *next) {
    if (slave_call(instance, function, "next_event") != STATUS_OK) return STATUS_ERROR;
    *next = instance->floats[1];
    return STATUS_OK;
}

/* Without leave to return early the block handles what happens within the step by itself; only an event at the step's
 * end is left to the host. */
Status events_step(Instance *instance, const char *function, double t, double dt, StepEnd *end) {
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

/* Settles what is due at this instant; gives the time of the next known event, or infinity. */
Status events_update(Instance *instance, const char *function, double *next) {
    *next = INFINITY;
    if (instance->events.clock_active && sampling_settle(instance, function) != STATUS_OK) return STATUS_ERROR;
    if (!has_events(instance)) return STATUS_OK;
    if (ask_next_event(instance, function, next) != STATUS_OK) return STATUS_ERROR;
    if (!instance->events.event_pending && *next > instance->floats[0] + time_tolerance(instance)) return STATUS_OK;
    if (handle_event(instance, function) != STATUS_OK) return STATUS_ERROR;
    return ask_next_event(instance, function, next);
}
