/* Variables that are set, which waits for the next other call, and read, which a step may have done before.
 *
 * Texts and binaries that lie in the memory of another instance are not copied: the unit's process maps that. */
#include "proxy.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

int set_variables(Connection *c, int id, const uint32_t *references, size_t n, const void *values, size_t n_values,
                  size_t bytes) {
    Call call;
    open_call(c, &call, id);
    give_bytes(c, &call, references, n * sizeof *references);
    give_number(c, &call, n);
    give_bytes(c, &call, values, n_values * bytes);
    give_number(c, &call, n_values);
    return defer_call(c, &call);
}

static Known *find(Connection *c, int id, const uint32_t *references, size_t n, size_t n_values) {
    for (size_t i = 0; i < c->n_known; i++) {
        Known *known = &c->known[i];
        if (known->call == id && known->n == n && known->n_values == n_values &&
            !memcmp(known->references, references, n * sizeof *references))
            return known;
    }
    return NULL;
}

static Known *add(Connection *c, int id, const uint32_t *references, size_t n, size_t n_values, size_t bytes) {
    Shared *shared = c->channel.shared;
    size_t all = n_values * (bytes ? bytes : sizeof(Place));
    Known *more = realloc(c->known, (c->n_known + 1) * sizeof *more);
    uint32_t *copy = malloc(n * sizeof *copy + 1);
    if (more)
        c->known = more;
    uint64_t at = heap_take(shared, c->size, sizeof(Slot)), where = heap_take(shared, c->size, n * sizeof *copy + 1);
    uint64_t values = heap_take(shared, c->size, all + 1);
    if (!more || !copy || !at || !where || !values) {
        free(copy);
        return NULL;
    }
    memcpy(copy, references, n * sizeof *copy);
    memcpy(c->base + where, references, n * sizeof *copy);
    memset(c->base + values, 0, all);
    *(Slot *)(c->base + at) = (Slot){.call = id, .n = n, .n_values = n_values, .references = where, .values = values};
    c->known[c->n_known] = (Known){
        .call = id, .at = at, .values_at = values, .n = n, .n_values = n_values, .bytes = bytes, .references = copy};
    return &c->known[c->n_known++];
}

/* Return the bytes of a text or a binary that was read last; an empty one where the unit wrote over its place, and NULL
 * where it gave that for some bytes. */
static char *content(Connection *c, const Known *known, uint32_t which, size_t i, uint64_t *size) {
    const Place *place = (const Place *)(c->base + known->values_at) + i;
    uint64_t at = place->at[which & 1];
    *size = place->size[which & 1];
    if (!at && *size)
        return NULL;
    if (at >= c->size || *size >= c->size - at)
        *size = 0, at = known->values_at;
    return c->base + at;
}

static void take_texts(Connection *c, const Known *known, const char **texts, size_t *sizes) {
    Slot *slot = (Slot *)(c->base + known->at);
    uint32_t which = slot->held = slot->written & 1;
    for (size_t i = 0; i < known->n_values; i++) {
        uint64_t size;
        char *bytes = content(c, known, which, i, &size);
        texts[i] = bytes;
        if (sizes)
            sizes[i] = size;
        else if (bytes && size)
            bytes[size - 1] = 0;
        else
            texts[i] = "";
    }
}

/* Read `n_values` numbers of so many bytes; of 0 bytes: texts, or with `sizes` binaries. */
int get_variables(Connection *c, int id, const uint32_t *references, size_t n, void *values, size_t n_values,
                  size_t bytes, size_t *sizes) {
    if (c->in_flight)
        end_step(c, NULL);
    if (c->ending != RUNNING)
        return FATAL;
    Known *known = find(c, id, references, n, n_values);
    if (!known)
        known = add(c, id, references, n, n_values, bytes);
    if (!known)
        return ERROR;
    int status = read_known(c, known);
    if (succeeded(status) && bytes)
        memcpy(values, c->base + known->values_at, n_values * bytes);
    else if (succeeded(status))
        take_texts(c, known, values, sizes);
    return status;
}

/* Let the unit's process map the memory of another instance, unless it has or cannot. */
static int map_memory(Connection *c, Connection *other) {
    if (other->number >= MAX_MAPS || c->mapped[other->number])
        return OK;
    char path[64];
    snprintf(path, sizeof path, "/proc/%ld/fd/%d", (long)getpid(), other->file);
    Call call;
    open_call(c, &call, CALL_map_memory);
    give_number(c, &call, (uint64_t)other->number);
    give_text(c, &call, path);
    give_number(c, &call, other->size);
    int status = close_call(c, &call);
    if (c->failed >= 0 || status > DISCARD)
        return status;
    c->mapped[other->number] = status == OK ? 1 : 2;
    return OK;
}

static bool has_mapped(const Connection *c, const Connection *other) {
    return other && other != c && other->number < MAX_MAPS && c->mapped[other->number] == 1;
}

enum { WORTH_MAPPING = 4096 }; /* bytes from which a copy costs more than it is worth */

void give_table(Connection *c, Call *call, const void *const *values, const size_t *sizes, uint64_t n) {
    uint64_t table = extend(c, call, (n ? n : 1) * sizeof(uint64_t));
    for (uint64_t i = 0; table && i < n; i++) {
        uint64_t size = sizes ? sizes[i] : values[i] ? strlen(values[i]) + 1 : 0, offset = 0;
        Connection *other = values[i] && size >= WORTH_MAPPING ? owner(values[i]) : NULL;
        if (has_mapped(c, other))
            offset = ELSEWHERE(other->number, (const char *)values[i] - other->base);
        else if (values[i])
            offset = copied(c, call, values[i], size);
        memcpy(c->base + table + i * sizeof offset, &offset, sizeof offset);
    }
    add_argument(c, call, table, true);
    if (call->at && table) {
        record(c, call->at)->table = table;
        record(c, call->at)->n_table = n;
    }
}

int set_table(Connection *c, int id, const uint32_t *references, size_t n, const void *const *values,
              const size_t *sizes, size_t n_values) {
    Call call;
    if (c->ending != RUNNING)
        return FATAL;
    if (c->in_flight)
        end_step(c, NULL);
    for (size_t i = 0; sizes && i < n_values; i++) {
        Connection *other = values[i] && sizes[i] >= WORTH_MAPPING ? owner(values[i]) : NULL;
        int status = other && other != c ? map_memory(c, other) : OK;
        if (status != OK)
            return status;
    }
    open_call(c, &call, id);
    give_bytes(c, &call, references, n * sizeof *references);
    give_number(c, &call, n);
    if (sizes)
        give_bytes(c, &call, sizes, n_values * sizeof *sizes);
    give_table(c, &call, values, sizes, n_values);
    give_number(c, &call, n_values);
    return defer_call(c, &call);
}
