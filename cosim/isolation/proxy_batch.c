/* The batch of calls: they are written one after another, and made when the result of one is wanted. */
#include "proxy.h"

#include <string.h>

Record *record(Connection *c, uint64_t at) { return (Record *)(c->base + at); }

static uint64_t batch_end(const Connection *c) { return BATCH_AT + c->channel.shared->batch_used; }

/* Return room at the end of the batch, 0 if there is none. */
uint64_t extend(Connection *c, Call *call, uint64_t size) {
    Shared *shared = c->channel.shared;
    uint64_t at = batch_end(c), more = aligned(size);
    if (!call->at || size > c->size || at + more > c->size / 2) {
        call->at = 0;
        return 0;
    }
    shared->batch_used += more;
    record(c, call->at)->size += more;
    return at;
}

static void clear_batch(Connection *c) { c->channel.shared->batch_used = 0; }

bool open_call(Connection *c, Call *call, int id) {
    *call = (Call){0};
    if (c->ending != RUNNING)
        return false;
    if (c->in_flight)
        end_step(c, NULL);
    if (c->ending != RUNNING)
        return false;
    call->at = batch_end(c);
    if (!extend(c, call, sizeof(Record)))
        return false;
    *record(c, call->at) = (Record){.call = id, .size = sizeof(Record)};
    return true;
}

void add_argument(Connection *c, Call *call, uint64_t value, bool is_address) {
    if (!call->at)
        return;
    Record *r = record(c, call->at);
    int i = call->n_arguments++;
    r->arguments[i] = value;
    r->addresses |= (uint32_t)is_address << i;
}

void give_number(Connection *c, Call *call, uint64_t number) { add_argument(c, call, number, false); }

void give_real(Connection *c, Call *call, int i, double real) {
    if (call->at)
        record(c, call->at)->reals[i] = real;
}

uint64_t copied(Connection *c, Call *call, const void *bytes, uint64_t size) {
    uint64_t at = bytes ? extend(c, call, size ? size : 1) : 0;
    if (at && size)
        memcpy(c->base + at, bytes, size);
    return at;
}

void give_bytes(Connection *c, Call *call, const void *bytes, uint64_t size) {
    call->last = copied(c, call, bytes, size);
    add_argument(c, call, call->last, true);
}

void give_text(Connection *c, Call *call, const char *text) { give_bytes(c, call, text, text ? strlen(text) + 1 : 0); }

void take_bytes(Connection *c, Call *call, void *bytes, uint64_t size) {
    uint64_t at = bytes ? extend(c, call, size ? size : 1) : 0;
    add_argument(c, call, at, true);
    if (!at)
        return;
    call->results[call->n_results].to = bytes;
    call->results[call->n_results].from = at;
    call->results[call->n_results++].size = size;
}

void give_and_take(Connection *c, Call *call, void *bytes, uint64_t size) {
    take_bytes(c, call, bytes, size);
    if (call->at && bytes)
        memcpy(c->base + call->results[call->n_results - 1].from, bytes, size);
}

static void take_results(Connection *c, const Call *call) {
    for (int i = 0; i < call->n_results; i++)
        memcpy(call->results[i].to, c->base + call->results[i].from, call->results[i].size);
}

/* Note that no room is left, as the unit's own log would. */
static int too_large(Connection *c) {
    const char *text = "a value is larger than the memory that is shared with the unit's process";
    clear_batch(c);
    if (c->logger_2)
        c->logger_2(c->environment, c->name ? c->name : "", ERROR, "unit", "%s", text);
    else if (c->logger_3)
        c->logger_3(c->environment, ERROR, "unit", text);
    return ERROR;
}

/* Count the calls that answered Warning after they had returned OK: all of the batch but the one that is `reported`. */
static void count_warnings(Connection *c, uint64_t reported) {
    Shared *shared = c->channel.shared;
    if (!shared->warned)
        return;
    shared->warned = 0;
    for (uint64_t at = BATCH_AT, end = batch_end(c); at < end && at <= c->size / 2 - sizeof(Record);) {
        const Record *r = record(c, at);
        int id = r->call;
        if (at != reported && !r->after_step && r->status == WARNING && id >= 0 && id < N_CALLS && !c->warned[id].n++)
            c->warned[id].first = c->time ? *c->time : 0;
        if (r->size < sizeof(Record) || r->size > c->size)
            return;
        at += r->size;
    }
}

/* Read the status of the batch that was made until the record at `wanted`, and clear it. */
static int outcome(Connection *c, uint64_t wanted) {
    Shared *shared = c->channel.shared;
    uint64_t stopped = shared->stopped_at;
    int status = ERROR;
    if (stopped >= BATCH_AT && stopped <= c->size / 2 - sizeof(Record)) {
        const Record *r = record(c, stopped);
        status = r->status;
        if (stopped != wanted)
            c->failed = r->call >= 0 && r->call < N_CALLS ? r->call : -1;
    }
    if (status == FATAL)
        end_process(c, BY_MASTER); /* the standards forbid all further calls */
    clear_batch(c);
    return status;
}

static int exchange(Connection *c, uint64_t wanted) {
    c->failed = -1;
    channel_give(&c->channel);
    bool answered = await(c);
    count_warnings(c, wanted);
    return answered ? outcome(c, wanted) : FATAL;
}

int close_call(Connection *c, Call *call) {
    if (c->ending != RUNNING)
        return FATAL;
    if (!call->at)
        return too_large(c);
    c->generation++;
    int status = exchange(c, call->at);
    if (c->ending == RUNNING && c->failed < 0)
        take_results(c, call);
    return status;
}

int defer_call(Connection *c, Call *call) {
    if (!c->in_step_mode || !call->at)
        return close_call(c, call);
    c->generation++;
    return OK;
}

int call_plain(Connection *c, int id) {
    Call call;
    open_call(c, &call, id);
    return close_call(c, &call);
}

static void add_gets(Connection *c) {
    for (size_t i = 0; i < c->n_known; i++) {
        Known *known = &c->known[i];
        Call get = {.at = batch_end(c)};
        if (!known->asked || !extend(c, &get, sizeof(Record)))
            continue;
        *record(c, get.at) = (Record){
            .call = CALL_get_slot, .size = sizeof(Record), .after_step = 1, .addresses = 1, .arguments = {known->at}};
        ((Slot *)(c->base + known->at))->done = 0;
        known->generation = c->generation;
        known->asked = false;
    }
}

/* Let the batch be made, up to the step and on to the reading of what was asked for since the one before. */
void start_step(Connection *c, Call *call) {
    if (!call->at) {
        too_large(c);
        return;
    }
    c->generation++;
    c->step_at = call->at;
    add_gets(c);
    c->in_flight = true;
    c->failed = -1;
    channel_give(&c->channel);
}

/* Whether the process ended while it read variables for the calls that follow the step. */
static bool ended_after_step(const Connection *c) {
    return c->channel.shared->stopped_at == c->step_at && c->failed >= 0 && c->failed != CALL_fmi2DoStep &&
           c->failed != CALL_fmi3DoStep;
}

int end_step(Connection *c, bool *has_results) {
    if (!c->in_flight)
        return c->ending == RUNNING ? ERROR : FATAL; /* it could not be begun */
    c->in_flight = false;
    bool answered = await(c), went_on = !answered && ended_after_step(c);
    count_warnings(c, c->step_at);
    int status = answered ? outcome(c, c->step_at) : went_on ? record(c, c->step_at)->status : FATAL;
    if (has_results)
        *has_results = went_on || (c->ending == RUNNING && c->failed < 0);
    return status;
}

void change_mode(Connection *c, bool in_step_mode) {
    c->in_step_mode = in_step_mode;
    for (size_t i = 0; i < c->n_known; i++)
        c->known[i].asked = false;
}

API int isolation_load(Connection *c, const char *path, const char *prefix) {
    Call call;
    open_call(c, &call, CALL_load_library);
    give_text(c, &call, path);
    give_text(c, &call, prefix);
    return close_call(c, &call);
}

API int isolation_unload(Connection *c) { return call_plain(c, CALL_unload_library); }

API void isolation_log_to(Connection *c, Logger3 logger) {
    c->logger_2 = NULL;
    c->logger_3 = logger;
}

/* Have the unit's process read variables, unless it has since the last change; return the status. */
int read_known(Connection *c, Known *known) {
    Slot *slot = (Slot *)(c->base + known->at);
    if (c->in_flight)
        end_step(c, NULL);
    if (c->ending != RUNNING)
        return FATAL;
    if (known->generation != c->generation || !slot->done) {
        Call call;
        if (!open_call(c, &call, CALL_get_slot))
            return close_call(c, &call);
        add_argument(c, &call, known->at, true);
        slot->done = 0;
        known->generation = c->generation;
        int status = exchange(c, call.at);
        if (c->failed >= 0 || c->ending != RUNNING)
            return status;
    }
    known->asked = c->in_step_mode;
    return slot->status;
}
