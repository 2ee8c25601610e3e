/* Calls that both standards have in the same form: what is logged, the experiment, saved states.
 *
 * A saved state stays in the unit's process: the master holds its address there. */
#include "proxy.h"

int set_debug_logging(Connection *c, int id, bool on, size_t n, const char *const names[]) {
    Call call;
    open_call(c, &call, id);
    give_number(c, &call, on);
    give_number(c, &call, n);
    give_table(c, &call, (const void *const *)names, NULL, n);
    return close_call(c, &call);
}

int set_up_experiment(Connection *c, int id, bool has_tolerance, double tolerance, double start, bool has_stop,
                      double stop) {
    Call call;
    open_call(c, &call, id);
    give_number(c, &call, has_tolerance);
    give_number(c, &call, has_stop);
    give_real(c, &call, 0, tolerance);
    give_real(c, &call, 1, start);
    give_real(c, &call, 2, stop);
    return close_call(c, &call);
}

int get_or_free_state(Connection *c, int id, void **state) {
    Call call;
    open_call(c, &call, id);
    give_and_take(c, &call, state, sizeof *state);
    return close_call(c, &call);
}

int set_state(Connection *c, int id, void *state) {
    Call call;
    open_call(c, &call, id);
    give_number(c, &call, (uint64_t)state);
    return close_call(c, &call);
}

int get_state_size(Connection *c, int id, void *state, size_t *size) {
    Call call;
    open_call(c, &call, id);
    give_number(c, &call, (uint64_t)state);
    give_and_take(c, &call, size, sizeof *size);
    return close_call(c, &call);
}

int serialize_state(Connection *c, int id, void *state, void *bytes, size_t size) {
    Call call;
    open_call(c, &call, id);
    give_number(c, &call, (uint64_t)state);
    take_bytes(c, &call, bytes, size);
    give_number(c, &call, size);
    return close_call(c, &call);
}

int deserialize_state(Connection *c, int id, const void *bytes, size_t size, void **state) {
    Call call;
    open_call(c, &call, id);
    give_bytes(c, &call, bytes, size);
    give_number(c, &call, size);
    give_and_take(c, &call, state, sizeof *state);
    return close_call(c, &call);
}
