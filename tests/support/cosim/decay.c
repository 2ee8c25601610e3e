/* A foreign unit in plain C, FMI 2.0: x' = -x + u, stepped exactly, y = x.
 * Its parameter `mode` spoils one thing, as other people's units do; the tests tell which. What happens while the
 * library is loaded is chosen by the environment variable DECAY_ON_LOAD. */
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { X, U, Y, N_REALS };
enum mode {
    SOUND, ABORTS, SEGMENTATION_FAULT, NOT_A_NUMBER, ANSWERS_ERROR, DISCARDS, FORGETS_IN_STATE, HANGS, EXITS,
    SHARES_MEMORY, DOES_NOT_RESET, OUT_OF_RANGE
};

typedef struct {
    double values[N_REALS];
    int mode, steps;
    fmi2CallbackLogger log;
    fmi2ComponentEnvironment environment;
} Unit;

static double shared_x; /* what a careless exporter makes of a model's global variables */

#ifdef NEEDS_OTHER
int other(void);
int use_other(void) { return other(); }
#endif

__attribute__((constructor)) static void on_load(void) {
    const char *wish = getenv("DECAY_ON_LOAD");
    if (wish && !strcmp(wish, "abort")) {
        fprintf(stderr, "no licence for Decay\n");
        abort();
    }
    if (wish && !strcmp(wish, "crash"))
        raise(SIGSEGV);
    while (wish && !strcmp(wish, "hang"))
        ;
}

static void begin(Unit *unit) {
    unit->values[X] = unit->values[Y] = 1.0;
    unit->values[U] = 0.0;
    unit->steps = 0;
    shared_x = 1.0;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    if (strcmp(guid, "decay")) {
        functions->logger(functions->componentEnvironment, name, fmi2Error, "error", "wrong guid %s", guid);
        return NULL;
    }
    Unit *unit = calloc(1, sizeof *unit);
    unit->log = functions->logger;
    unit->environment = functions->componentEnvironment;
    begin(unit);
    return unit;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) { return fmi2OK; }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) { return fmi2OK; }

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    if (((Unit *)c)->mode == SEGMENTATION_FAULT)
        raise(SIGSEGV);
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }

fmi2Status fmi2Reset(fmi2Component c) {
    if (((Unit *)c)->mode != DOES_NOT_RESET)
        begin(c);
    return fmi2OK;
}

static fmi2Status spoil_step(Unit *unit, double t) {
    switch (unit->mode) {
    case ABORTS:
        abort();
    case HANGS:
        for (;;)
            ;
    case EXITS:
        exit(0);
    case NOT_A_NUMBER:
        unit->values[X] = NAN;
        return fmi2OK;
    case OUT_OF_RANGE:
        unit->values[X] = 1e6;
        return fmi2OK;
    case DISCARDS:
        return fmi2Discard;
    case ANSWERS_ERROR:
        unit->log(unit->environment, "decay", fmi2Error, "error", "the solver failed at t = %g", t);
        return fmi2Error;
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_rollback) {
    Unit *unit = c;
    double *x = unit->mode == SHARES_MEMORY ? &shared_x : &unit->values[X];
    *x = unit->values[U] + (*x - unit->values[U]) * exp(-h);
    fmi2Status status = ++unit->steps == 3 ? spoil_step(unit, t) : fmi2OK;
    unit->values[Y] = *x;
    return status;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real values[]) {
    for (size_t i = 0; i < n; i++)
        values[i] = vr[i] == Y && ((Unit *)c)->mode == SHARES_MEMORY ? shared_x : ((Unit *)c)->values[vr[i]];
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real values[]) {
    for (size_t i = 0; i < n; i++)
        ((Unit *)c)->values[vr[i]] = values[i];
    return fmi2OK;
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer values[]) {
    for (size_t i = 0; i < n; i++)
        ((Unit *)c)->mode = values[i];
    return fmi2OK;
}

#ifndef WITHOUT_STATE
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    *state = malloc(sizeof(Unit));
    memcpy(*state, c, sizeof(Unit));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    Unit *unit = c, *kept = state;
    double x = unit->values[X];
    *unit = *kept;
    if (unit->mode == FORGETS_IN_STATE)
        unit->values[X] = x;
    return fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    free(*state);
    *state = NULL;
    return fmi2OK;
}
#endif
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    *size = sizeof(Unit);
    return fmi2OK;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    memcpy(bytes, state, size);
    return fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    *state = malloc(size);
    memcpy(*state, bytes, size);
    return fmi2OK;
}

/* what this unit has no use for */
#define REFUSED(name, ...)                                                                                             \
    fmi2Status name(fmi2Component c, __VA_ARGS__) { return fmi2Error; }
#define REFERENCES const fmi2ValueReference vr[], size_t n
REFUSED(fmi2GetInteger, REFERENCES, fmi2Integer values[])
REFUSED(fmi2GetBoolean, REFERENCES, fmi2Boolean values[])
REFUSED(fmi2SetBoolean, REFERENCES, const fmi2Boolean values[])
REFUSED(fmi2GetString, REFERENCES, fmi2String values[])
REFUSED(fmi2SetString, REFERENCES, const fmi2String values[])
REFUSED(fmi2SetRealInputDerivatives, REFERENCES, const fmi2Integer order[], const fmi2Real values[])
REFUSED(fmi2GetRealOutputDerivatives, REFERENCES, const fmi2Integer order[], fmi2Real values[])
REFUSED(fmi2GetDirectionalDerivative, const fmi2ValueReference unknown[], size_t n, const fmi2ValueReference known[],
        size_t m, const fmi2Real d_known[], fmi2Real d_unknown[])
REFUSED(fmi2GetStatus, const fmi2StatusKind kind, fmi2Status *value)
REFUSED(fmi2GetRealStatus, const fmi2StatusKind kind, fmi2Real *value)
REFUSED(fmi2GetIntegerStatus, const fmi2StatusKind kind, fmi2Integer *value)
REFUSED(fmi2GetBooleanStatus, const fmi2StatusKind kind, fmi2Boolean *value)
REFUSED(fmi2GetStringStatus, const fmi2StatusKind kind, fmi2String *value)
fmi2Status fmi2CancelStep(fmi2Component c) { return fmi2Error; }
