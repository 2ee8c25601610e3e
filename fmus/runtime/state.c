/* Saved states: what the host gets, sets, frees, serialises. */
#include <stdlib.h>
#include <string.h>

#include "log.h"
#include "slave.h"
#include "state.h"

#define MAGIC 0x48435354u /* "HCST": begins a serialised state */
#define VERSION 2u

typedef struct {
    uint32_t magic, version;
    uint32_t mode;
    uint8_t has_outputs, outputs_stale, unused[2];
    double stop_time;
    Events events;
    uint64_t size;
    uint64_t digest; /* of a serialised state; it is 0 while it is worked out, and in memory */
} StateHeader;

struct SavedState {
    SavedState *next;
    StateHeader header;
    char *bytes; /* what fmus/slave.py made: the buffers with the time, and the block's own state */
};

/* FNV-1a by words, with the upper half folded in: else what only differs in the highest bits of two words is the same. */
static uint64_t digest_on(uint64_t digest, const void *bytes, size_t size) {
    for (const char *at = bytes; size > 0;) {
        uint64_t word = 0;
        size_t n = size < sizeof word ? size : sizeof word;
        memcpy(&word, at, n);
        digest = (digest ^ word) * 0x100000001b3u;
        digest ^= digest >> 32;
        at += n;
        size -= n;
    }
    return digest;
}

/* The digest detects a state that was damaged on its way: a block's own code is not expected to. */
static uint64_t digest_of(StateHeader header, const char *bytes) {
    header.digest = 0;
    return digest_on(digest_on(0xcbf29ce484222325u, &header, sizeof header), bytes, header.size);
}

static void release(SavedState *state) {
    free(state->bytes);
    free(state);
}

void states_free(Instance *instance) {
    for (SavedState *state = instance->states; state;) {
        SavedState *next = state->next;
        release(state);
        state = next;
    }
    instance->states = NULL;
}

/* The pointer to a state in the instance's list; NULL and a log line if the state is not one of this instance. */
static SavedState **find(Instance *instance, const char *function, const void *state) {
    for (SavedState **at = &instance->states; *at; at = &(*at)->next)
        if (*at == state) return at;
    refuse(instance, function, "%s",
           state ? "this state was not saved from this instance, or it was freed" : "the state is NULL");
    return NULL;
}

static SavedState *add(Instance *instance, const char *function) {
    SavedState *state = calloc(1, sizeof *state);
    if (!state) {
        refuse(instance, function, "no memory for a state");
        return NULL;
    }
    state->next = instance->states;
    instance->states = state;
    return state;
}

Status state_get(Instance *instance, const char *function, void **state) {
    if (!allowed(instance, function, ANY_MODE & ~FAILED) || !given(instance, function, state, "FMUState"))
        return STATUS_ERROR;
    SavedState **old = *state ? find(instance, function, *state) : NULL;
    if (*state && !old) return STATUS_ERROR;
    char *bytes = NULL;
    size_t size = 0;
    if (slave_get_state(instance, function, &bytes, &size) != STATUS_OK) return STATUS_ERROR;
    SavedState *saved = old ? *old : add(instance, function);
    if (!saved) {
        free(bytes);
        return STATUS_ERROR;
    }
    free(saved->bytes);
    saved->bytes = bytes;
    saved->header = (StateHeader){.magic = MAGIC,
                                  .version = VERSION,
                                  .mode = instance->mode,
                                  .has_outputs = instance->has_outputs,
                                  .outputs_stale = instance->outputs_stale,
                                  .stop_time = instance->stop_time,
                                  .events = instance->events,
                                  .size = size};
    *state = saved;
    return STATUS_OK;
}

Status state_set(Instance *instance, const char *function, void *state) {
    if (!allowed(instance, function, ANY_MODE)) return STATUS_ERROR;
    SavedState **at = find(instance, function, state);
    if (!at) return STATUS_ERROR;
    const StateHeader *header = &(*at)->header;
    if (header->mode == EVENT && !instance->event_mode_used)
        return refuse(instance, function,
                      "the state was saved in event mode, by an instance with eventModeUsed = fmi3True; this one was "
                      "made without");
    if (slave_set_state(instance, function, (*at)->bytes, header->size) != STATUS_OK) return STATUS_ERROR;
    instance->mode = (Mode)header->mode;
    instance->has_outputs = header->has_outputs;
    instance->outputs_stale = header->outputs_stale;
    instance->stop_time = header->stop_time;
    instance->events = header->events;
    if (instance->events.clock_active) { /* the block's state is that of before the tick */
        instance->events.evaluated = false;
        instance->outputs_stale = true;
    }
    return STATUS_OK;
}

Status state_free(Instance *instance, const char *function, void **state) {
    if (!allowed(instance, function, ANY_MODE)) return STATUS_ERROR;
    if (!state || !*state) return STATUS_OK; /* the standards let NULL be freed */
    SavedState **at = find(instance, function, *state);
    if (!at) return STATUS_ERROR;
    SavedState *gone = *at;
    *at = gone->next;
    release(gone);
    *state = NULL;
    return STATUS_OK;
}

Status state_size(Instance *instance, const char *function, void *state, size_t *size) {
    if (!allowed(instance, function, ANY_MODE) || !given(instance, function, size, "size")) return STATUS_ERROR;
    SavedState **at = find(instance, function, state);
    if (!at) return STATUS_ERROR;
    *size = sizeof(StateHeader) + (*at)->header.size;
    return STATUS_OK;
}

Status state_serialise(Instance *instance, const char *function, void *state, void *bytes, size_t size) {
    if (!allowed(instance, function, ANY_MODE) || !given(instance, function, bytes, "serializedState"))
        return STATUS_ERROR;
    SavedState **at = find(instance, function, state);
    if (!at) return STATUS_ERROR;
    const StateHeader *header = &(*at)->header;
    if (size < sizeof *header + header->size)
        return refuse(instance, function, "%zu bytes where the state has %zu", size,
                      sizeof *header + (size_t)header->size);
    StateHeader written = *header;
    written.digest = digest_of(written, (*at)->bytes);
    memcpy(bytes, &written, sizeof written);
    memcpy((char *)bytes + sizeof *header, (*at)->bytes, header->size);
    return STATUS_OK;
}

static bool plausible(const StateHeader *header, size_t size) {
    uint32_t mode = header->mode;
    bool one_mode = mode && (mode & (mode - 1)) == 0 && mode < FAILED;
    return header->magic == MAGIC && header->version == VERSION && one_mode && header->size <= size - sizeof *header;
}

Status state_deserialise(Instance *instance, const char *function, const void *bytes, size_t size, void **state) {
    if (!allowed(instance, function, ANY_MODE) || !given(instance, function, bytes, "serializedState") ||
        !given(instance, function, state, "FMUState"))
        return STATUS_ERROR;
    StateHeader header;
    if (size >= sizeof header) memcpy(&header, bytes, sizeof header);
    const char *rest = (const char *)bytes + sizeof header;
    if (size < sizeof header || !plausible(&header, size))
        return refuse(instance, function, "these %zu bytes are not a state that this unit serialised", size);
    if (header.digest != digest_of(header, rest))
        return refuse(instance, function, "these %zu bytes were changed since this unit serialised them", size);
    char *copy = malloc(header.size ? header.size : 1);
    SavedState *saved = copy ? add(instance, function) : NULL;
    if (!saved) {
        free(copy);
        return STATUS_ERROR;
    }
    memcpy(copy, rest, header.size);
    header.digest = 0;
    saved->header = header;
    saved->bytes = copy;
    *state = saved;
    return STATUS_OK;
}
