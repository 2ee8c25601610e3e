/* An instance from instantiation to its end, through the modes that the host puts it in; steps and event mode are in
 * stepping.c. */
#include <math.h>
#include <stdlib.h>

#include "lifecycle.h"
#include "log.h"
#include "sampling.h"
#include "slave.h"
#include "state.h"
#include "text.h"
#include "variables.h"

Instance *instance_new(const char *name, Logger *log, void (*host_logger)(void), void *environment, bool logging) {
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) return NULL;
    instance->name = copy_of(name ? name : "");
    instance->log = log;
    instance->host_logger = host_logger;
    instance->host_environment = environment;
    instance->logged = logging ? LOG_EVERYTHING : 0;
    instance->mode = INSTANTIATED;
    instance->stop_time = INFINITY;
    if (instance->name) return instance;
    free(instance);
    return NULL;
}

void instance_free(Instance *instance) {
    if (!instance) return;
    states_free(instance);
    slave_release(instance);
    free(instance->table);
    free(instance->name);
    free(instance);
}

Status instance_set_times(Instance *instance, const char *function, double start, bool has_stop, double stop) {
    if (!isfinite(start)) return refuse(instance, function, "the start time is %g", start);
    if (has_stop && !(stop >= start))
        return refuse(instance, function, "the stop time %.17g s is before the start time %.17g s", stop, start);
    instance->floats[0] = start;
    instance->stop_time = has_stop ? stop : INFINITY;
    return STATUS_OK;
}

Status instance_enter_initialisation(Instance *instance, const char *function) {
    instance->mode = INITIALISATION;
    instance->outputs_stale = true;
    note(instance, function, "initialising at t = %.17g s", instance->floats[0]);
    return STATUS_OK;
}

/* Outputs are computed when the host gets them, as it sets one variable after another. Between steps they are those of
 * the last step, whatever was set since. */
Status instance_refresh_outputs(Instance *instance, const char *function) {
    if (!instance->outputs_stale) return STATUS_OK;
    if (instance->events.clock_active && instance->mode == EVENT) return sampling_evaluate(instance, function);
    if (instance->mode != INITIALISATION) return STATUS_OK;
    if (!inputs_finite(instance, function)) return STATUS_ERROR;
    if (slave_call(instance, function, "initialise") != STATUS_OK) return STATUS_ERROR;
    if (check_outputs(instance, function) != STATUS_OK) return STATUS_ERROR;
    instance->outputs_stale = false;
    instance->has_outputs = true;
    return STATUS_OK;
}

Status instance_exit_initialisation(Instance *instance, const char *function) {
    if (instance_refresh_outputs(instance, function) != STATUS_OK) return STATUS_ERROR;
    instance->events = (Events){.start = instance->floats[0]};
    instance->mode = instance->event_mode_used ? EVENT : STEPPING;
    return STATUS_OK;
}

Status instance_terminate(Instance *instance, const char *function) {
    note(instance, function, "ends at t = %.17g s", instance->floats[0]);
    instance->mode = TERMINATED;
    return STATUS_OK;
}

/* Allowed in any mode, as it is also the recovery from a failure: there may be no interpreter any more. */
Status instance_reset(Instance *instance, const char *function) {
    if (!slave_revive(instance, function) || slave_call(instance, function, "reset") != STATUS_OK) return STATUS_ERROR;
    instance->mode = INSTANTIATED;
    instance->has_outputs = instance->outputs_stale = false;
    instance->stop_time = INFINITY;
    instance->events = (Events){0};
    return STATUS_OK;
}
