/* The functions of FMI 3.0. */
#include "proxy.h"

#include <string.h>

#define REFERENCES Connection *c, const uint32_t references[], size_t n

API const char *fmi3GetVersion(void) { return "3.0"; }

API Connection *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                            bool logging, bool event_mode, bool early_return,
                                            const uint32_t required[], size_t n_required, void *environment,
                                            Logger3 logger, void *intermediate) {
    Connection *c = take_next();
    if (!c)
        return NULL;
    Call call;
    c->logger_3 = logger;
    c->environment = environment;
    c->uses_events = event_mode;
    open_call(c, &call, CALL_fmi3InstantiateCoSimulation);
    give_text(c, &call, name);
    give_text(c, &call, token);
    give_text(c, &call, resources);
    give_number(c, &call, visible);
    give_number(c, &call, logging);
    give_number(c, &call, event_mode);
    give_number(c, &call, early_return);
    give_bytes(c, &call, required, n_required * sizeof *required);
    give_number(c, &call, n_required);
    return close_call(c, &call) == OK ? c : NULL;
}

API void fmi3FreeInstance(Connection *c) { call_plain(c, CALL_fmi3FreeInstance); }

API int fmi3SetDebugLogging(Connection *c, bool on, size_t n, const char *const names[]) {
    return set_debug_logging(c, CALL_fmi3SetDebugLogging, on, n, names);
}

API int fmi3EnterInitializationMode(Connection *c, bool has_tolerance, double tolerance, double start, bool has_stop,
                                    double stop) {
    return set_up_experiment(c, CALL_fmi3EnterInitializationMode, has_tolerance, tolerance, start, has_stop, stop);
}

static int change(Connection *c, int id, bool into_step_mode) {
    if (!into_step_mode)
        change_mode(c, false);
    int status = call_plain(c, id);
    change_mode(c, into_step_mode && succeeded(status));
    return status;
}

API int fmi3ExitInitializationMode(Connection *c) {
    return change(c, CALL_fmi3ExitInitializationMode, !c->uses_events);
}
API int fmi3EnterEventMode(Connection *c) { return change(c, CALL_fmi3EnterEventMode, false); }
API int fmi3EnterStepMode(Connection *c) { return change(c, CALL_fmi3EnterStepMode, true); }
API int fmi3Terminate(Connection *c) { return change(c, CALL_fmi3Terminate, false); }
API int fmi3Reset(Connection *c) { return change(c, CALL_fmi3Reset, false); }
PLAIN(fmi3EnterConfigurationMode)
PLAIN(fmi3ExitConfigurationMode)
PLAIN(fmi3EvaluateDiscreteStates)

API int fmi3UpdateDiscreteStates(Connection *c, bool *again, bool *terminate, bool *nominals, bool *states,
                                 bool *next_defined, double *next) {
    Call call;
    open_call(c, &call, CALL_fmi3UpdateDiscreteStates);
    bool *flags[] = {again, terminate, nominals, states, next_defined};
    for (size_t i = 0; i < sizeof flags / sizeof *flags; i++)
        give_and_take(c, &call, flags[i], sizeof(bool));
    give_and_take(c, &call, next, sizeof *next);
    return close_call(c, &call);
}

#define ACCESS(Type, type)                                                                                             \
    API int fmi3Get##Type(REFERENCES, type values[], size_t n_values) {                                                \
        return get_variables(c, CALL_fmi3Get##Type, references, n, values, n_values, sizeof *values, NULL);            \
    }                                                                                                                  \
    API int fmi3Set##Type(REFERENCES, const type values[], size_t n_values) {                                          \
        return set_variables(c, CALL_fmi3Set##Type, references, n, values, n_values, sizeof *values);                  \
    }
ACCESS(Float32, float)
ACCESS(Float64, double)
ACCESS(Int8, int8_t)
ACCESS(UInt8, uint8_t)
ACCESS(Int16, int16_t)
ACCESS(UInt16, uint16_t)
ACCESS(Int32, int32_t)
ACCESS(UInt32, uint32_t)
ACCESS(Int64, int64_t)
ACCESS(UInt64, uint64_t)
ACCESS(Boolean, bool)

API int fmi3GetString(REFERENCES, const char *values[], size_t n_values) {
    return get_variables(c, CALL_fmi3GetString, references, n, values, n_values, 0, NULL);
}
API int fmi3SetString(REFERENCES, const char *const values[], size_t n_values) {
    return set_table(c, CALL_fmi3SetString, references, n, (const void *const *)values, NULL, n_values);
}
API int fmi3GetBinary(REFERENCES, size_t sizes[], const uint8_t *values[], size_t n_values) {
    return get_variables(c, CALL_fmi3GetBinary, references, n, values, n_values, 0, sizes);
}
API int fmi3SetBinary(REFERENCES, const size_t sizes[], const uint8_t *const values[], size_t n_values) {
    return set_table(c, CALL_fmi3SetBinary, references, n, (const void *const *)values, sizes, n_values);
}
API int fmi3GetClock(REFERENCES, bool values[]) {
    return get_variables(c, CALL_fmi3GetClock, references, n, values, n, sizeof *values, NULL);
}
API int fmi3SetClock(REFERENCES, const bool values[]) {
    return set_variables(c, CALL_fmi3SetClock, references, n, values, n, sizeof *values);
}

API int fmi3GetFMUState(Connection *c, void **state) { return get_or_free_state(c, CALL_fmi3GetFMUState, state); }
API int fmi3SetFMUState(Connection *c, void *state) { return set_state(c, CALL_fmi3SetFMUState, state); }
API int fmi3FreeFMUState(Connection *c, void **state) { return get_or_free_state(c, CALL_fmi3FreeFMUState, state); }
API int fmi3SerializedFMUStateSize(Connection *c, void *state, size_t *size) {
    return get_state_size(c, CALL_fmi3SerializedFMUStateSize, state, size);
}
API int fmi3SerializeFMUState(Connection *c, void *state, uint8_t bytes[], size_t size) {
    return serialize_state(c, CALL_fmi3SerializeFMUState, state, bytes, size);
}
API int fmi3DeserializeFMUState(Connection *c, const uint8_t bytes[], size_t size, void **state) {
    return deserialize_state(c, CALL_fmi3DeserializeFMUState, bytes, size, state);
}

#define DERIVATIVE(name)                                                                                               \
    API int name(Connection *c, const uint32_t unknowns[], size_t n, const uint32_t knowns[], size_t m,                \
                 const double seed[], size_t n_seed, double change[], size_t n_change) {                               \
        Call call;                                                                                                     \
        open_call(c, &call, CALL_##name);                                                                              \
        give_bytes(c, &call, unknowns, n * sizeof *unknowns);                                                          \
        give_number(c, &call, n);                                                                                      \
        give_bytes(c, &call, knowns, m * sizeof *knowns);                                                              \
        give_number(c, &call, m);                                                                                      \
        give_bytes(c, &call, seed, n_seed * sizeof *seed);                                                             \
        give_number(c, &call, n_seed);                                                                                 \
        take_bytes(c, &call, change, n_change * sizeof *change);                                                       \
        give_number(c, &call, n_change);                                                                               \
        return close_call(c, &call);                                                                                   \
    }
DERIVATIVE(fmi3GetDirectionalDerivative)
DERIVATIVE(fmi3GetAdjointDerivative)

API int fmi3GetOutputDerivatives(REFERENCES, const int32_t orders[], double values[], size_t n_values) {
    Call call;
    open_call(c, &call, CALL_fmi3GetOutputDerivatives);
    give_bytes(c, &call, references, n * sizeof *references);
    give_number(c, &call, n);
    give_bytes(c, &call, orders, n * sizeof *orders);
    take_bytes(c, &call, values, n_values * sizeof *values);
    give_number(c, &call, n_values);
    return close_call(c, &call);
}

/* References, then arrays with an entry for each. */
static int clocks(Connection *c, int id, const uint32_t references[], size_t n, void *arrays[], const size_t bytes[],
                  int n_arrays) {
    Call call;
    open_call(c, &call, id);
    give_bytes(c, &call, references, n * sizeof *references);
    give_number(c, &call, n);
    for (int i = 0; i < n_arrays; i++)
        give_and_take(c, &call, arrays[i], n * bytes[i]);
    return close_call(c, &call);
}

API int fmi3GetIntervalDecimal(REFERENCES, double intervals[], int qualifiers[]) {
    return clocks(c, CALL_fmi3GetIntervalDecimal, references, n, (void *[]){intervals, qualifiers},
                  (size_t[]){sizeof(double), sizeof(int)}, 2);
}
API int fmi3GetIntervalFraction(REFERENCES, uint64_t counters[], uint64_t resolutions[], int qualifiers[]) {
    return clocks(c, CALL_fmi3GetIntervalFraction, references, n, (void *[]){counters, resolutions, qualifiers},
                  (size_t[]){sizeof(uint64_t), sizeof(uint64_t), sizeof(int)}, 3);
}
#define ONE_ARRAY(name, type)                                                                                          \
    API int name(REFERENCES, type values[]) {                                                                          \
        return clocks(c, CALL_##name, references, n, (void *[]){(void *)values}, (size_t[]){sizeof *values}, 1);       \
    }
#define TWO_ARRAYS(name, type)                                                                                         \
    API int name(REFERENCES, type counters[], type resolutions[]) {                                                    \
        return clocks(c, CALL_##name, references, n, (void *[]){(void *)counters, (void *)resolutions},                \
                      (size_t[]){sizeof *counters, sizeof *resolutions}, 2);                                           \
    }
ONE_ARRAY(fmi3GetShiftDecimal, double)
ONE_ARRAY(fmi3SetShiftDecimal, const double)
ONE_ARRAY(fmi3SetIntervalDecimal, const double)
TWO_ARRAYS(fmi3GetShiftFraction, uint64_t)
TWO_ARRAYS(fmi3SetShiftFraction, const uint64_t)
TWO_ARRAYS(fmi3SetIntervalFraction, const uint64_t)

enum flag { EVENT_NEEDED, TERMINATE, EARLY, LAST_TIME };
static const size_t flag_bytes[] = {sizeof(bool), sizeof(bool), sizeof(bool), sizeof(double)};

API void isolation_begin_step_3(Connection *c, double t, double h, int no_rollback) {
    Call call;
    bool no = false;
    double end = t + h; /* what units leave as it is */
    if (!open_call(c, &call, CALL_fmi3DoStep))
        return;
    give_number(c, &call, no_rollback != 0);
    give_real(c, &call, 0, t);
    give_real(c, &call, 1, h);
    for (int i = EVENT_NEEDED; i <= LAST_TIME; i++) {
        give_bytes(c, &call, i == LAST_TIME ? (void *)&end : &no, flag_bytes[i]);
        c->flags_at[i] = call.at ? call.last : 0;
    }
    start_step(c, &call);
}

API int fmi3DoStep(Connection *c, double t, double h, bool no_rollback, bool *event_needed, bool *terminate,
                   bool *early, double *last_time) {
    void *flags[] = {event_needed, terminate, early, last_time};
    if (!c->in_flight)
        isolation_begin_step_3(c, t, h, no_rollback);
    bool has_results = false;
    int status = end_step(c, &has_results);
    for (int i = EVENT_NEEDED; has_results && i <= LAST_TIME; i++)
        memcpy(flags[i], c->base + c->flags_at[i], flag_bytes[i]);
    return status;
}

#define REFUSED(name)                                                                                                  \
    API int name(void) { return ERROR; }
REFUSED(fmi3GetNumberOfVariableDependencies)
REFUSED(fmi3GetVariableDependencies)
REFUSED(fmi3EnterContinuousTimeMode)
REFUSED(fmi3CompletedIntegratorStep)
REFUSED(fmi3SetTime)
REFUSED(fmi3SetContinuousStates)
REFUSED(fmi3GetContinuousStateDerivatives)
REFUSED(fmi3GetEventIndicators)
REFUSED(fmi3GetContinuousStates)
REFUSED(fmi3GetNominalsOfContinuousStates)
REFUSED(fmi3GetNumberOfEventIndicators)
REFUSED(fmi3GetNumberOfContinuousStates)
REFUSED(fmi3ActivateModelPartition)
API void *fmi3InstantiateModelExchange(void) { return NULL; }
API void *fmi3InstantiateScheduledExecution(void) { return NULL; }
