/* FMI 3.0: life, time and states of a co-simulation slave. */
#include <stdlib.h>

#include "fmi.h"
#include "lifecycle.h"
#include "log.h"
#include "platform.h"
#include "sampling.h"
#include "slave.h"
#include "state.h"
#include "stepping.h"
#include "text.h"

/* The callback does not say whose message it is, so the message begins with the instance's name. */
static void log_message(const Instance *instance, Status status, const char *category, const char *message) {
    Text named = {0};
    text_add(&named, *instance->name ? "%s: %s" : "%s%s", instance->name, message);
    ((fmi3LogMessageCallback)instance->host_logger)(instance->host_environment, (fmi3Status)status, category,
                                                    named.chars ? named.chars : message);
    text_clear(&named);
}

#define BEGIN(modes)             \
    Instance *instance = handle; \
    if (!allowed(instance, __func__, modes)) return fmi3Error

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Status fmi3SetDebugLogging(fmi3Instance handle, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    return (fmi3Status)set_logging(handle, __func__, on, n, categories);
}

/* hasEventMode is for the host to look at. One that asks for event mode where there is none gets an error, rather than
 * wait for events that never come. One that uses it where there is a clock, and never makes the clock tick, is accepted:
 * the unit then ticks by itself. */
static bool may_use_event_mode(const Instance *instance, const char *function) {
    if (!instance->event_mode_used || has_clock(instance) || has_events(instance)) return true;
    refuse(instance, function, "eventModeUsed is true, but the unit has no event mode (hasEventMode is false)");
    return false;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t n_intermediate,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                         fmi3IntermediateUpdateCallback update) {
    (void)visible;
    (void)intermediate;
    (void)update;
    Instance *instance = instance_new(name, log_message, (void (*)(void))logger, environment, logging);
    if (!instance) return NULL;
    instance->event_mode_used = event_mode;
    instance->early_return_allowed = early_return;
    if (n_intermediate > 0)
        warn(instance, __func__, "steps have no intermediate points: the %zu variables will not be updated within them",
             n_intermediate);
    bool started = false;
    if (given(instance, __func__, token, "instantiationToken") &&
        given(instance, __func__, resources, "resourcePath")) {
        char *folder = platform_path(resources);
        started = folder && slave_start(instance, __func__, folder, token) && may_use_event_mode(instance, __func__);
        free(folder);
    }
    if (started) return instance;
    instance_free(instance);
    return NULL;
}

static fmi3Instance refuse_kind(const char *function, const char *kind, fmi3String name,
                                fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger) {
    Instance *instance = instance_new(name, log_message, (void (*)(void))logger, environment, false);
    if (!instance) return NULL;
    refuse(instance, function, "not supported: this unit is a co-simulation slave, it has no %s form", kind);
    instance_free(instance);
    return NULL;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback logger) {
    (void)token, (void)resources, (void)visible, (void)logging;
    return refuse_kind(__func__, "model-exchange", name, environment, logger);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    (void)token, (void)resources, (void)visible, (void)logging, (void)update, (void)lock, (void)unlock;
    return refuse_kind(__func__, "scheduled-execution", name, environment, logger);
}

void fmi3FreeInstance(fmi3Instance handle) { instance_free(handle); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance handle, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
    (void)tolerance_defined;
    (void)tolerance;
    BEGIN(INSTANTIATED);
    if (instance_set_times(instance, __func__, start, stop_defined, stop) != STATUS_OK) return fmi3Error;
    return (fmi3Status)instance_enter_initialisation(instance, __func__);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance handle) {
    BEGIN(INITIALISATION);
    return (fmi3Status)instance_exit_initialisation(instance, __func__);
}

fmi3Status fmi3Terminate(fmi3Instance handle) {
    BEGIN(STEPPING | EVENT);
    return (fmi3Status)instance_terminate(instance, __func__);
}

fmi3Status fmi3Reset(fmi3Instance handle) {
    BEGIN(ANY_MODE);
    return (fmi3Status)instance_reset(instance, __func__);
}

fmi3Status fmi3DoStep(fmi3Instance handle, fmi3Float64 t, fmi3Float64 dt, fmi3Boolean no_set_state_prior,
                      fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last_time) {
    (void)no_set_state_prior;
    BEGIN(STEPPING);
    if (!given(instance, __func__, event_needed, "eventHandlingNeeded") ||
        !given(instance, __func__, terminate, "terminateSimulation") ||
        !given(instance, __func__, early, "earlyReturn") || !given(instance, __func__, last_time, "lastSuccessfulTime"))
        return fmi3Error;
    *event_needed = *terminate = *early = false;
    StepEnd end = {false, false};
    Status status = instance_step(instance, __func__, t, dt, &end);
    *early = end.early;
    *event_needed = end.event_needed;
    *last_time = instance->floats[0];
    return (fmi3Status)status;
}

fmi3Status fmi3GetFMUState(fmi3Instance handle, fmi3FMUState *state) {
    return (fmi3Status)state_get(handle, __func__, state);
}

fmi3Status fmi3SetFMUState(fmi3Instance handle, fmi3FMUState state) {
    return (fmi3Status)state_set(handle, __func__, state);
}

fmi3Status fmi3FreeFMUState(fmi3Instance handle, fmi3FMUState *state) {
    return (fmi3Status)state_free(handle, __func__, state);
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance handle, fmi3FMUState state, size_t *size) {
    return (fmi3Status)state_size(handle, __func__, state, size);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance handle, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    return (fmi3Status)state_serialise(handle, __func__, state, bytes, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance handle, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    return (fmi3Status)state_deserialise(handle, __func__, bytes, size, state);
}
