/* FMI 2.0: the standard's functions for a co-simulation slave. */
#include <stdlib.h>
#include <string.h>

#include "derivatives.h"
#include "fmi.h"
#include "lifecycle.h"
#include "log.h"
#include "platform.h"
#include "slave.h"
#include "state.h"
#include "stepping.h"
#include "text.h"
#include "values.h"
#include "variables.h"

#define ASYNCHRONOUS "steps are done when fmi2DoStep returns"
#define DERIVATIVES "derivatives of inputs and outputs with respect to time are not provided"
#define MODEL_EXCHANGE "this unit is a co-simulation slave, it has no model-exchange form"

#define MOST_LOGGED 1800 /* characters: hosts print a message into a buffer of, often, 2 kB and lose what is beyond */

/* A logger's message is a printf format in which # begins a reference to a variable: both are doubled. */
static void log_message(const Instance *instance, Status status, const char *category, const char *message) {
    Text kept = {0};
    text_add_shortened(&kept, message, MOST_LOGGED);
    char *escaped = malloc(2 * kept.length + 1);
    if (escaped) {
        char *to = escaped;
        for (const char *from = text_of(&kept); *from; *to++ = *from++)
            if (*from == '%' || *from == '#') *to++ = *from;
        *to = 0;
        fmi2CallbackLogger logger = (fmi2CallbackLogger)instance->host_logger;
        logger(instance->host_environment, instance->name, (fmi2Status)status, category, escaped);
    }
    free(escaped);
    text_clear(&kept);
}

#define BEGIN(modes)        \
    Instance *instance = c; \
    if (!allowed(instance, __func__, modes)) return fmi2Error

const char *fmi2GetTypesPlatform(void) { return "default"; }

const char *fmi2GetVersion(void) { return "2.0"; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    return (fmi2Status)set_logging(c, __func__, on, n, categories);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging) {
    (void)visible;
    if (!host) return NULL;
    Instance *instance =
        instance_new(name, log_message, (void (*)(void))host->logger, host->componentEnvironment, logging);
    if (!instance) return NULL;
    bool started = false;
    if (type != fmi2CoSimulation)
        refuse_unsupported(instance, __func__, MODEL_EXCHANGE);
    else if (given(instance, __func__, guid, "fmuGUID") &&
             given(instance, __func__, resources, "fmuResourceLocation")) {
        char *folder = platform_path(resources);
        started = folder && slave_start(instance, __func__, folder, guid);
        free(folder);
    }
    if (started) return instance;
    instance_free(instance);
    return NULL;
}

void fmi2FreeInstance(fmi2Component c) { instance_free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop) {
    (void)tolerance_defined;
    (void)tolerance;
    BEGIN(INSTANTIATED);
    return (fmi2Status)instance_set_times(instance, __func__, start, stop_defined, stop);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    BEGIN(INSTANTIATED);
    return (fmi2Status)instance_enter_initialisation(instance, __func__);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    BEGIN(INITIALISATION);
    return (fmi2Status)instance_exit_initialisation(instance, __func__);
}

fmi2Status fmi2Terminate(fmi2Component c) {
    BEGIN(STEPPING);
    return (fmi2Status)instance_terminate(instance, __func__);
}

fmi2Status fmi2Reset(fmi2Component c) {
    BEGIN(ANY_MODE);
    return (fmi2Status)instance_reset(instance, __func__);
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real values[]) {
    return (fmi2Status)get_floats(c, __func__, ANY_TYPE, vr, n, values, n);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real values[]) {
    return (fmi2Status)set_floats(c, __func__, ANY_TYPE, vr, n, values, n);
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer values[]) {
    Instance *instance = c;
    if (!may_get(instance, __func__, INT64, ANY_TYPE, vr, n, values, n)) return fmi2Error;
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = variable_of(instance, vr[i]);
        int64_t value = instance->integers[variable->offset];
        if (value >= (variable->type == TYPE_UINT64 ? 0 : INT32_MIN) && value <= INT32_MAX) {
            values[i] = (fmi2Integer)value;
            continue;
        }
        const char *format = variable->type == TYPE_UINT64 ? "the value %llu of variable %u has no place in 32 bits"
                                                           : "the value %lld of variable %u has no place in 32 bits";
        return (fmi2Status)refuse(instance, __func__, format, (long long)value, vr[i]);
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer values[]) {
    Instance *instance = c;
    if (!may_set(instance, __func__, INT64, ANY_TYPE, vr, n, values, n)) return fmi2Error;
    for (size_t i = 0; i < n; i++)
        if (!takes_integer(instance, __func__, vr[i], values[i])) return fmi2Error;
    for (size_t i = 0; i < n; i++) instance->integers[variable_of(instance, vr[i])->offset] = values[i];
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean values[]) {
    Instance *instance = c;
    if (!may_get(instance, __func__, BOOLEAN, ANY_TYPE, vr, n, values, n)) return fmi2Error;
    for (size_t i = 0; i < n; i++) values[i] = instance->booleans[variable_of(instance, vr[i])->offset] != 0;
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean values[]) {
    Instance *instance = c;
    if (!may_set(instance, __func__, BOOLEAN, ANY_TYPE, vr, n, values, n)) return fmi2Error;
    for (size_t i = 0; i < n; i++) instance->booleans[variable_of(instance, vr[i])->offset] = values[i] != 0;
    return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String values[]) {
    return (fmi2Status)get_strings(c, __func__, ANY_TYPE, vr, n, values, n);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String values[]) {
    return (fmi2Status)set_strings(c, __func__, ANY_TYPE, vr, n, values, n);
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    return (fmi2Status)state_get(c, __func__, state);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) { return (fmi2Status)state_set(c, __func__, state); }

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    return (fmi2Status)state_free(c, __func__, state);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    return (fmi2Status)state_size(c, __func__, state, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    return (fmi2Status)state_serialise(c, __func__, state, bytes, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    return (fmi2Status)state_deserialise(c, __func__, bytes, size, state);
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real dt, fmi2Boolean no_set_state_prior) {
    (void)no_set_state_prior;
    BEGIN(STEPPING);
    StepEnd end;
    return (fmi2Status)instance_step(instance, __func__, t, dt, &end);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t n_unknowns,
                                        const fmi2ValueReference knowns[], size_t n_knowns, const fmi2Real seed[],
                                        fmi2Real sensitivity[]) {
    return (fmi2Status)get_derivative(c, __func__, false, unknowns, n_unknowns, knowns, n_knowns, seed, n_knowns,
                                      sensitivity, n_unknowns);
}

/* The standard's return value for a status that does not exist. */
static fmi2Status discard(const Instance *instance, const char *function, const char *reason) {
    if (!instance) return fmi2Error;
    refuse(instance, function, "there is no such status: %s", reason);
    return fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    BEGIN(STEPPING | TERMINATED | FAILED);
    if (!given(instance, __func__, value, "value")) return fmi2Error;
    if (kind != fmi2LastSuccessfulTime)
        return discard(instance, __func__, "only fmi2LastSuccessfulTime is a real one");
    *value = instance->floats[0];
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    BEGIN(STEPPING | TERMINATED | FAILED);
    if (!given(instance, __func__, value, "value")) return fmi2Error;
    if (kind != fmi2Terminated) return discard(instance, __func__, "only fmi2Terminated is a boolean one");
    *value = 0; /* a unit never asks for the end of the simulation */
    return fmi2OK;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    return discard(c, __func__, ASYNCHRONOUS);
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    return discard(c, __func__, ASYNCHRONOUS);
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    return discard(c, __func__, ASYNCHRONOUS);
}

#define UNSUPPORTED(reason, function, ...)                                     \
    fmi2Status function(fmi2Component c, __VA_ARGS__) {                        \
        return (fmi2Status)refuse_unsupported(c, __func__, reason);            \
    }
#define UNSUPPORTED_BARE(reason, function)                                     \
    fmi2Status function(fmi2Component c) {                                     \
        return (fmi2Status)refuse_unsupported(c, __func__, reason);            \
    }

UNSUPPORTED_BARE(ASYNCHRONOUS, fmi2CancelStep)
UNSUPPORTED(DERIVATIVES, fmi2SetRealInputDerivatives, const fmi2ValueReference vr[], size_t n,
            const fmi2Integer order[], const fmi2Real v[])
UNSUPPORTED(DERIVATIVES, fmi2GetRealOutputDerivatives, const fmi2ValueReference vr[], size_t n,
            const fmi2Integer order[], fmi2Real v[])
UNSUPPORTED_BARE(MODEL_EXCHANGE, fmi2EnterEventMode)
UNSUPPORTED_BARE(MODEL_EXCHANGE, fmi2EnterContinuousTimeMode)
UNSUPPORTED(MODEL_EXCHANGE, fmi2NewDiscreteStates, fmi2EventInfo *info)
UNSUPPORTED(MODEL_EXCHANGE, fmi2CompletedIntegratorStep, fmi2Boolean no_set, fmi2Boolean *event, fmi2Boolean *end)
UNSUPPORTED(MODEL_EXCHANGE, fmi2SetTime, fmi2Real t)
UNSUPPORTED(MODEL_EXCHANGE, fmi2SetContinuousStates, const fmi2Real x[], size_t n)
UNSUPPORTED(MODEL_EXCHANGE, fmi2GetDerivatives, fmi2Real x[], size_t n)
UNSUPPORTED(MODEL_EXCHANGE, fmi2GetEventIndicators, fmi2Real z[], size_t n)
UNSUPPORTED(MODEL_EXCHANGE, fmi2GetContinuousStates, fmi2Real x[], size_t n)
UNSUPPORTED(MODEL_EXCHANGE, fmi2GetNominalsOfContinuousStates, fmi2Real x[], size_t n)
