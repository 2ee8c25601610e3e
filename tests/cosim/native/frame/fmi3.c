/* The co-simulation interface of FMI 3.0, with Event Mode and Clocks. */
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"
#include "unit.h"

#define REFERENCES fmi3Instance c, const fmi3ValueReference vr[], size_t n
#define READABLE (INITIALIZATION | STEP | EVENT | TERMINATED)

static void log_fmi3(Unit *unit, enum status status, const char *message) {
    fmi3LogMessageCallback logger = (fmi3LogMessageCallback)unit->owner;
    if (logger)
        logger(unit->environment, (fmi3Status)status, "unit", message);
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference required[], size_t n_required,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                         fmi3IntermediateUpdateCallback intermediate) {
    Unit *unit = new_unit(token, name);
    if (!unit) {
        if (logger)
            logger(environment, fmi3Error, "unit", "wrong instantiation token");
        return NULL;
    }
    unit->owner = (void *)logger;
    unit->environment = environment;
    unit->log = log_fmi3;
    unit->fmi = 3;
    unit->event_mode = event_mode && unit->model->abilities & EVENTS;
    unit->early_return = early_return && unit->model->abilities & EARLY_RETURN;
    if (unit->model->created)
        unit->model->created(unit);
    return unit;
}

void fmi3FreeInstance(fmi3Instance c) {
    if (c)
        free_unit(c);
}
fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String names[]) {
    say(c, OK, "%zu categories are chosen", n);
    return fmi3OK;
}

static fmi3Status enter(Unit *unit, int from, enum mode to, const char *call) {
    if (!allowed(unit, from, call))
        return fmi3Error;
    unit->kept->mode = to;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop) {
    Unit *unit = c;
    if (enter(unit, INSTANTIATED, INITIALIZATION, "fmi3EnterInitializationMode") != fmi3OK)
        return fmi3Error;
    set_up(unit, has_tolerance, tolerance, start, has_stop, stop);
    if (unit->model->initialize)
        unit->model->initialize(unit);
    return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    return enter(c, INITIALIZATION, ((Unit *)c)->event_mode ? EVENT : STEP, "fmi3ExitInitializationMode");
}
fmi3Status fmi3EnterEventMode(fmi3Instance c) {
    return enter(c, ((Unit *)c)->event_mode ? STEP : 0, EVENT, "fmi3EnterEventMode");
}
fmi3Status fmi3EnterStepMode(fmi3Instance c) { return enter(c, EVENT, STEP, "fmi3EnterStepMode"); }
fmi3Status fmi3Terminate(fmi3Instance c) {
    fmi3Status status = enter(c, STEP | EVENT, TERMINATED, "fmi3Terminate");
    const Model *model = ((Unit *)c)->model;
    return status == fmi3OK && model->terminate ? (fmi3Status)model->terminate(c) : status;
}
fmi3Status fmi3Reset(fmi3Instance c) {
    begin(c);
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                    fmi3Boolean *states, fmi3Boolean *next_defined, fmi3Float64 *next) {
    Unit *unit = c;
    Update update = {0};
    if (!allowed(unit, EVENT, "fmi3UpdateDiscreteStates"))
        return fmi3Error;
    refresh(unit);
    if (unit->model->update)
        unit->model->update(unit, &update);
    for (size_t i = 0; i < unit->model->n_variables; i++) /* every Clock is inactive afterwards */
        if (unit->model->variables[i].type == CLOCK)
            *(int32_t *)place(unit, &unit->model->variables[i]) = false;
    unit->kept->stale = true;
    *again = update.again;
    *terminate = update.terminate;
    *nominals = *states = false;
    *next_defined = update.next_defined;
    *next = update.next;
    return fmi3OK;
}
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) { return fmi3OK; }

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_rollback, fmi3Boolean *event_needed,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last_time) {
    StepEnd end;
    fmi3Status status = (fmi3Status)do_step(c, t, h, &end);
    *event_needed = end.event_needed;
    *terminate = end.terminate;
    *early = end.early;
    *last_time = status == fmi3OK ? end.last_time : t;
    return status;
}

fmi3Status fmi3GetFloat64(REFERENCES, fmi3Float64 values[], size_t n_values) {
    Unit *unit = c;
    if (!allowed(unit, READABLE, "fmi3GetFloat64"))
        return fmi3Error;
    refresh(unit);
    for (size_t i = 0, at = 0; i < n; i++) {
        const Variable *v = vr[i] ? variable(unit, vr[i], REAL, false, "fmi3GetFloat64") : NULL;
        size_t length = v && v->length ? v->length : 1;
        if ((vr[i] && !v) || at + length > n_values)
            return fmi3Error;
        memcpy(values + at, v ? place(unit, v) : &unit->kept->time, length * sizeof *values);
        at += length;
    }
    return fmi3OK;
}
fmi3Status fmi3SetFloat64(REFERENCES, const fmi3Float64 values[], size_t n_values) {
    Unit *unit = c;
    for (size_t i = 0, at = 0; i < n; i++) {
        const Variable *v = variable(unit, vr[i], REAL, true, "fmi3SetFloat64");
        size_t length = v && v->length ? v->length : 1;
        if (!v || at + length > n_values)
            return fmi3Error;
        memcpy(place(unit, v), values + at, length * sizeof *values);
        at += length;
    }
    return fmi3OK;
}

#define ACCESS(Type, kind, extra)                                                                                      \
    fmi3Status fmi3Get##Type(REFERENCES, fmi3##Type values[] extra) {                                                  \
        if (!allowed(c, READABLE, "fmi3Get" #Type))                                                                    \
            return fmi3Error;                                                                                          \
        refresh(c);                                                                                                    \
        for (size_t i = 0; i < n; i++) {                                                                               \
            const Variable *v = variable(c, vr[i], kind, false, "fmi3Get" #Type);                                      \
            if (!v)                                                                                                    \
                return fmi3Error;                                                                                      \
            values[i] = *(int32_t *)place(c, v);                                                                       \
        }                                                                                                              \
        return fmi3OK;                                                                                                 \
    }                                                                                                                  \
    fmi3Status fmi3Set##Type(REFERENCES, const fmi3##Type values[] extra) {                                            \
        for (size_t i = 0; i < n; i++) {                                                                               \
            const Variable *v = variable(c, vr[i], kind, true, "fmi3Set" #Type);                                       \
            if (!v || (kind == CLOCK && !allowed(c, EVENT | INITIALIZATION, "fmi3SetClock")))                          \
                return fmi3Error;                                                                                      \
            *(int32_t *)place(c, v) = values[i];                                                                       \
        }                                                                                                              \
        return fmi3OK;                                                                                                 \
    }
#define WITH_COUNT , size_t n_values
ACCESS(Int32, INTEGER, WITH_COUNT)
ACCESS(Boolean, BOOLEAN, WITH_COUNT)
ACCESS(Clock, CLOCK, )

fmi3Status fmi3GetBinary(REFERENCES, size_t sizes[], fmi3Binary values[], size_t n_values) {
    if (!allowed(c, READABLE, "fmi3GetBinary"))
        return fmi3Error;
    refresh(c);
    for (size_t i = 0; i < n; i++) {
        const Variable *v = variable(c, vr[i], BINARY, false, "fmi3GetBinary");
        if (!v)
            return fmi3Error;
        Bytes *bytes = place(c, v);
        sizes[i] = bytes->size;
        values[i] = bytes->bytes;
    }
    return fmi3OK;
}
fmi3Status fmi3SetBinary(REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t n_values) {
    for (size_t i = 0; i < n; i++) {
        const Variable *v = variable(c, vr[i], BINARY, true, "fmi3SetBinary");
        if (!v || sizes[i] > MAX_BYTES)
            return fmi3Error;
        Bytes *bytes = place(c, v);
        *bytes = (Bytes){.size = sizes[i]};
        memcpy(bytes->bytes, values[i], sizes[i]);
    }
    return fmi3OK;
}

fmi3Status fmi3GetIntervalFraction(REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                   fmi3IntervalQualifier qualifiers[]) {
    for (size_t i = 0; i < n; i++) {
        const Variable *v = variable(c, vr[i], CLOCK, false, "fmi3GetIntervalFraction");
        if (!v || !v->counter)
            return fmi3Error;
        counters[i] = (fmi3UInt64)v->counter;
        resolutions[i] = (fmi3UInt64)v->resolution;
        qualifiers[i] = fmi3IntervalUnchanged;
    }
    return fmi3OK;
}
fmi3Status fmi3GetIntervalDecimal(REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]) {
    Unit *unit = c;
    for (size_t i = 0; i < n; i++) {
        fmi3UInt64 counter, resolution;
        const Variable *v = variable(unit, vr[i], CLOCK, false, "fmi3GetIntervalDecimal");
        if (v && v->timing && allowed(unit, INITIALIZATION | EVENT, "fmi3GetIntervalDecimal")) {
            qualifiers[i] = (fmi3IntervalQualifier)unit->model->interval(unit, intervals + i);
            continue;
        }
        if (fmi3GetIntervalFraction(c, vr + i, 1, &counter, &resolution, qualifiers + i) != fmi3OK)
            return fmi3Error;
        intervals[i] = (fmi3Float64)counter / (fmi3Float64)resolution;
    }
    return fmi3OK;
}
fmi3Status fmi3GetShiftDecimal(REFERENCES, fmi3Float64 shifts[]) {
    memset(shifts, 0, n * sizeof *shifts);
    return fmi3OK;
}
fmi3Status fmi3GetShiftFraction(REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]) {
    for (size_t i = 0; i < n; i++)
        counters[i] = 0, resolutions[i] = 1;
    return fmi3OK;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknown[], size_t n,
                                        const fmi3ValueReference known[], size_t m, const fmi3Float64 seed[],
                                        size_t n_seed, fmi3Float64 change[], size_t n_change) {
    return n_seed == m && n_change == n ? (fmi3Status)sensitivity(c, unknown, n, known, m, seed, change) : fmi3Error;
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) { return (fmi3Status)save(c, state); }
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { return (fmi3Status)restore(c, state); }
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    free(*state);
    *state = NULL;
    return fmi3OK;
}
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    *size = kept_size(c);
    return fmi3OK;
}
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    if (size != kept_size(c))
        return fmi3Error;
    memcpy(bytes, state, size);
    return fmi3OK;
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    if (size != kept_size(c))
        return fmi3Error;
    *state = malloc(size);
    memcpy(*state, bytes, size);
    return fmi3OK;
}
