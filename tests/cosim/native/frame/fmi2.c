/* The co-simulation interface of FMI 2.0. */
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "unit.h"

#define REFERENCES fmi2Component c, const fmi2ValueReference vr[], size_t n

static void log_fmi2(Unit *unit, enum status status, const char *message) {
    fmi2CallbackLogger logger = (fmi2CallbackLogger)unit->owner;
    logger(unit->environment, unit->name, (fmi2Status)status, "unit", "%s", message);
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    Unit *unit = new_unit(guid, name);
    if (!unit) {
        functions->logger(functions->componentEnvironment, name, fmi2Error, "unit", "wrong guid %s", guid);
        return NULL;
    }
    unit->owner = (void *)functions->logger;
    unit->environment = functions->componentEnvironment;
    unit->log = log_fmi2;
    unit->fmi = 2;
    if (unit->model->created)
        unit->model->created(unit);
    return unit;
}

void fmi2FreeInstance(fmi2Component c) {
    if (c)
        free_unit(c);
}
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) {
    say(c, OK, "%zu categories are chosen", n);
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) {
    set_up(c, has_tolerance, tolerance, start, has_stop, stop);
    return allowed(c, INSTANTIATED, "fmi2SetupExperiment") ? fmi2OK : fmi2Error;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Unit *unit = c;
    if (!allowed(unit, INSTANTIATED, "fmi2EnterInitializationMode"))
        return fmi2Error;
    unit->kept->mode = INITIALIZATION;
    if (unit->model->initialize)
        unit->model->initialize(unit);
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    if (!allowed(c, INITIALIZATION, "fmi2ExitInitializationMode"))
        return fmi2Error;
    ((Unit *)c)->kept->mode = STEP;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    if (!allowed(c, STEP, "fmi2Terminate"))
        return fmi2Error;
    ((Unit *)c)->kept->mode = TERMINATED;
    const Model *model = ((Unit *)c)->model;
    return model->terminate ? (fmi2Status)model->terminate(c) : fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    begin(c);
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_rollback) {
    StepEnd end;
    fmi2Status status = (fmi2Status)do_step(c, t, h, &end);
    return status == fmi2OK && end.terminate ? fmi2Discard : status;
}

#define ACCESS(Type, kind, Field)                                                                                      \
    fmi2Status fmi2Get##Type(REFERENCES, fmi2##Type values[]) {                                                        \
        if (!allowed(c, INITIALIZATION | STEP | TERMINATED, "fmi2Get" #Type))                                          \
            return fmi2Error;                                                                                          \
        refresh(c);                                                                                                    \
        for (size_t i = 0; i < n; i++) {                                                                               \
            const Variable *v = variable(c, vr[i], kind, false, "fmi2Get" #Type);                                      \
            if (!v)                                                                                                    \
                return fmi2Error;                                                                                      \
            values[i] = *(Field *)place(c, v);                                                                         \
        }                                                                                                              \
        return fmi2OK;                                                                                                 \
    }                                                                                                                  \
    fmi2Status fmi2Set##Type(REFERENCES, const fmi2##Type values[]) {                                                  \
        for (size_t i = 0; i < n; i++) {                                                                               \
            const Variable *v = variable(c, vr[i], kind, true, "fmi2Set" #Type);                                       \
            if (!v)                                                                                                    \
                return fmi2Error;                                                                                      \
            *(Field *)place(c, v) = values[i];                                                                         \
        }                                                                                                              \
        return fmi2OK;                                                                                                 \
    }
ACCESS(Real, REAL, double)
ACCESS(Integer, INTEGER, int32_t)
ACCESS(Boolean, BOOLEAN, int32_t)
fmi2Status fmi2GetString(REFERENCES, fmi2String values[]) { return n ? fmi2Error : fmi2OK; }
fmi2Status fmi2SetString(REFERENCES, const fmi2String values[]) { return n ? fmi2Error : fmi2OK; }

fmi2Status fmi2SetRealInputDerivatives(REFERENCES, const fmi2Integer order[], const fmi2Real values[]) {
    Unit *unit = c;
    for (size_t i = 0; i < n; i++) {
        const Variable *v = variable(unit, vr[i], REAL, true, "fmi2SetRealInputDerivatives");
        if (!v || !(unit->model->abilities & INTERPOLATES) || order[i] < 1 || order[i] > MAX_ORDER)
            return fmi2Error;
        unit->kept->rates[v - unit->model->variables][order[i] - 1] = values[i];
    }
    return fmi2OK;
}
fmi2Status fmi2GetRealOutputDerivatives(REFERENCES, const fmi2Integer order[], fmi2Real values[]) { return fmi2Error; }

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n,
                                        const fmi2ValueReference known[], size_t m, const fmi2Real seed[],
                                        fmi2Real change[]) {
    return (fmi2Status)sensitivity(c, unknown, n, known, m, seed, change);
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) { return (fmi2Status)save(c, state); }
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) { return (fmi2Status)restore(c, state); }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    free(*state);
    *state = NULL;
    return fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    *size = kept_size(c);
    return fmi2OK;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    if (size != kept_size(c))
        return fmi2Error;
    memcpy(bytes, state, size);
    return fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    if (size != kept_size(c))
        return fmi2Error;
    *state = malloc(size);
    memcpy(*state, bytes, size);
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = ((Unit *)c)->kept->last_time;
    return fmi2OK;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    if (kind != fmi2Terminated)
        return fmi2Discard;
    *value = ((Unit *)c)->kept->terminated;
    return fmi2OK;
}
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) { return fmi2Discard; }
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind k, fmi2Integer *value) { return fmi2Discard; }
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind k, fmi2String *value) { return fmi2Discard; }
fmi2Status fmi2CancelStep(fmi2Component c) { return fmi2Error; }
