/* The functions of FMI 2.0. */
#define _GNU_SOURCE
#include "proxy.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    Logger2 logger;
    void *allocate, *release, *step_finished;
    void *environment;
} Callbacks;

#define REFERENCES Connection *c, const uint32_t references[], size_t n

API const char *fmi2GetTypesPlatform(void) { return "default"; }
API const char *fmi2GetVersion(void) { return "2.0"; }

API Connection *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                                const Callbacks *callbacks, int visible, int logging) {
    Connection *c = take_next();
    if (!c)
        return NULL;
    Call call;
    c->logger_3 = NULL;
    c->logger_2 = callbacks->logger;
    c->environment = callbacks->environment;
    c->name = strdup(name);
    open_call(c, &call, CALL_fmi2Instantiate);
    give_text(c, &call, name);
    give_number(c, &call, (uint64_t)type);
    give_text(c, &call, guid);
    give_text(c, &call, resources);
    give_number(c, &call, (uint64_t)visible);
    give_number(c, &call, (uint64_t)logging);
    return close_call(c, &call) == OK ? c : NULL;
}

API void fmi2FreeInstance(Connection *c) { call_plain(c, CALL_fmi2FreeInstance); }

API int fmi2SetDebugLogging(Connection *c, int on, size_t n, const char *const names[]) {
    return set_debug_logging(c, CALL_fmi2SetDebugLogging, on, n, names);
}

API int fmi2SetupExperiment(Connection *c, int has_tolerance, double tolerance, double start, int has_stop,
                            double stop) {
    return set_up_experiment(c, CALL_fmi2SetupExperiment, has_tolerance, tolerance, start, has_stop, stop);
}

PLAIN(fmi2EnterInitializationMode)
API int fmi2ExitInitializationMode(Connection *c) {
    int status = call_plain(c, CALL_fmi2ExitInitializationMode);
    change_mode(c, succeeded(status));
    return status;
}
API int fmi2Terminate(Connection *c) {
    change_mode(c, false);
    return call_plain(c, CALL_fmi2Terminate);
}
API int fmi2Reset(Connection *c) {
    change_mode(c, false);
    return call_plain(c, CALL_fmi2Reset);
}
PLAIN(fmi2CancelStep)

#define ACCESS(Type, type)                                                                                             \
    API int fmi2Get##Type(REFERENCES, type values[]) {                                                                 \
        return get_variables(c, CALL_fmi2Get##Type, references, n, values, n, sizeof *values, NULL);                   \
    }                                                                                                                  \
    API int fmi2Set##Type(REFERENCES, const type values[]) {                                                           \
        return set_variables(c, CALL_fmi2Set##Type, references, n, values, n, sizeof *values);                         \
    }
ACCESS(Real, double)
ACCESS(Integer, int)
ACCESS(Boolean, int)

API int fmi2GetString(REFERENCES, const char *values[]) {
    return get_variables(c, CALL_fmi2GetString, references, n, values, n, 0, NULL);
}
API int fmi2SetString(REFERENCES, const char *const values[]) {
    return set_table(c, CALL_fmi2SetString, references, n, (const void *const *)values, NULL, n);
}

API int fmi2SetRealInputDerivatives(REFERENCES, const int orders[], const double values[]) {
    Call call;
    open_call(c, &call, CALL_fmi2SetRealInputDerivatives);
    give_bytes(c, &call, references, n * sizeof *references);
    give_number(c, &call, n);
    give_bytes(c, &call, orders, n * sizeof *orders);
    give_bytes(c, &call, values, n * sizeof *values);
    return defer_call(c, &call);
}
API int fmi2GetRealOutputDerivatives(REFERENCES, const int orders[], double values[]) {
    Call call;
    open_call(c, &call, CALL_fmi2GetRealOutputDerivatives);
    give_bytes(c, &call, references, n * sizeof *references);
    give_number(c, &call, n);
    give_bytes(c, &call, orders, n * sizeof *orders);
    take_bytes(c, &call, values, n * sizeof *values);
    return close_call(c, &call);
}

API int fmi2GetFMUstate(Connection *c, void **state) { return get_or_free_state(c, CALL_fmi2GetFMUstate, state); }
API int fmi2SetFMUstate(Connection *c, void *state) { return set_state(c, CALL_fmi2SetFMUstate, state); }
API int fmi2FreeFMUstate(Connection *c, void **state) { return get_or_free_state(c, CALL_fmi2FreeFMUstate, state); }
API int fmi2SerializedFMUstateSize(Connection *c, void *state, size_t *size) {
    return get_state_size(c, CALL_fmi2SerializedFMUstateSize, state, size);
}
API int fmi2SerializeFMUstate(Connection *c, void *state, char bytes[], size_t size) {
    return serialize_state(c, CALL_fmi2SerializeFMUstate, state, bytes, size);
}
API int fmi2DeSerializeFMUstate(Connection *c, const char bytes[], size_t size, void **state) {
    return deserialize_state(c, CALL_fmi2DeSerializeFMUstate, bytes, size, state);
}

API int fmi2GetDirectionalDerivative(Connection *c, const uint32_t unknowns[], size_t n, const uint32_t knowns[],
                                     size_t m, const double seed[], double change[]) {
    Call call;
    open_call(c, &call, CALL_fmi2GetDirectionalDerivative);
    give_bytes(c, &call, unknowns, n * sizeof *unknowns);
    give_number(c, &call, n);
    give_bytes(c, &call, knowns, m * sizeof *knowns);
    give_number(c, &call, m);
    give_bytes(c, &call, seed, m * sizeof *seed);
    take_bytes(c, &call, change, n * sizeof *change);
    return close_call(c, &call);
}

API void isolation_begin_step_2(Connection *c, double t, double h, int no_rollback) {
    Call call;
    if (!open_call(c, &call, CALL_fmi2DoStep))
        return;
    give_number(c, &call, (uint64_t)no_rollback);
    give_real(c, &call, 0, t);
    give_real(c, &call, 1, h);
    start_step(c, &call);
}

API int fmi2DoStep(Connection *c, double t, double h, int no_rollback) {
    if (!c->in_flight)
        isolation_begin_step_2(c, t, h, no_rollback);
    return end_step(c, NULL);
}

#define STATUS(Type, type)                                                                                             \
    API int fmi2Get##Type(Connection *c, int kind, type *value) {                                                      \
        Call call;                                                                                                     \
        open_call(c, &call, CALL_fmi2Get##Type);                                                                       \
        give_number(c, &call, (uint64_t)kind);                                                                         \
        give_and_take(c, &call, value, sizeof *value);                                                                 \
        return close_call(c, &call);                                                                                   \
    }
STATUS(Status, int)
STATUS(RealStatus, double)
STATUS(IntegerStatus, int)
STATUS(BooleanStatus, int)
API int fmi2GetStringStatus(Connection *c, int kind, const char **value) { return DISCARD; }
