#include <math.h>
#include <string.h>

#include "instance.h"

static const char *kind_name(unsigned kind) {
    static const char *const names[] = {"a real", "an integer or enumeration", "a boolean", "a string", "a binary"};
    return kind < sizeof names / sizeof *names ? names[kind] : "of no kind";
}

static const char *name_of(const Instance *instance, const Variable *variable) {
    return instance->names + variable->name;
}

static bool known(const Instance *instance, const char *function, Kind kind, uint32_t reference) {
    if (reference >= instance->n_variables) {
        refuse(instance, function, "there is no variable with value reference %u", reference);
        return false;
    }
    const Variable *variable = variable_of(instance, reference);
    if (variable->kind == kind) return true;
    refuse(instance, function, "'%s' (value reference %u) is %s variable", name_of(instance, variable), reference,
           kind_name(variable->kind));
    return false;
}

static bool settable(const Instance *instance, const char *function, const Variable *variable) {
    bool before_start = instance->mode & (INSTANTIATED | INITIALISATION);
    const char *why;
    switch (variable->causality) {
        case INPUT: return true;
        case PARAMETER:
            if (before_start) return true;
            why = "is a parameter and fixed after initialisation";
            break;
        case OUTPUT: why = "is an output"; break;
        default: why = "is the time, which steps advance"; break;
    }
    refuse(instance, function, "'%s' cannot be set: it %s", name_of(instance, variable), why);
    return false;
}

static bool counted(const Instance *instance, const char *function, size_t count, const void *values, size_t n_values) {
    if (count > 0 && !given(instance, function, values, "values")) return false;
    if (count == n_values) return true;
    refuse(instance, function, "%zu values for variables with %zu entries", n_values, count);
    return false;
}

bool may_get(Instance *instance, const char *function, Kind kind, const uint32_t references[], size_t n,
             const void *values, size_t n_values) {
    if (!allowed(instance, function, ANY_MODE)) return false;
    if (n > 0 && !given(instance, function, references, "valueReferences")) return false;
    size_t count = 0;
    bool outputs = false;
    for (size_t i = 0; i < n; i++) {
        if (!known(instance, function, kind, references[i])) return false;
        const Variable *variable = variable_of(instance, references[i]);
        count += variable->count;
        if (variable->causality != OUTPUT) continue;
        outputs = true;
        if (instance->has_outputs || instance->mode == INITIALISATION) continue;
        refuse(instance, function, "the output '%s' has no value before initialisation", name_of(instance, variable));
        return false;
    }
    if (!counted(instance, function, count, values, n_values)) return false;
    return !outputs || instance_refresh_outputs(instance, function) == STATUS_OK;
}

bool may_set(Instance *instance, const char *function, Kind kind, const uint32_t references[], size_t n,
             const void *values, size_t n_values) {
    if (!allowed(instance, function, INSTANTIATED | INITIALISATION | STEPPING | EVENT)) return false;
    if (n > 0 && !given(instance, function, references, "valueReferences")) return false;
    size_t count = 0;
    for (size_t i = 0; i < n; i++) {
        if (!known(instance, function, kind, references[i])) return false;
        const Variable *variable = variable_of(instance, references[i]);
        if (!settable(instance, function, variable)) return false;
        count += variable->count;
    }
    if (!counted(instance, function, count, values, n_values)) return false;
    bool may_yet_be_refused = kind == STRING || kind == BINARY; /* one value by one, by whoever sets them */
    if (n > 0 && !may_yet_be_refused) instance->outputs_stale = true;
    return true;
}

Status get_floats(Instance *instance, const char *function, const uint32_t vr[], size_t n, double values[],
                  size_t n_values) {
    if (!may_get(instance, function, FLOAT64, vr, n, values, n_values)) return STATUS_ERROR;
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = variable_of(instance, vr[i]);
        memcpy(values, instance->floats + variable->offset, variable->count * sizeof *values);
        values += variable->count;
    }
    return STATUS_OK;
}

Status set_floats(Instance *instance, const char *function, const uint32_t vr[], size_t n, const double values[],
                  size_t n_values) {
    if (!may_set(instance, function, FLOAT64, vr, n, values, n_values)) return STATUS_ERROR;
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = variable_of(instance, vr[i]);
        memcpy(instance->floats + variable->offset, values, variable->count * sizeof *values);
        values += variable->count;
    }
    return STATUS_OK;
}

Status get_strings(Instance *instance, const char *function, const uint32_t vr[], size_t n, const char *values[],
                   size_t n_values) {
    if (!may_get(instance, function, STRING, vr, n, values, n_values)) return STATUS_ERROR;
    for (size_t i = 0; i < n; i++)
        if (slave_get_string(instance, function, variable_of(instance, vr[i])->offset, &values[i]) != STATUS_OK)
            return STATUS_ERROR;
    return STATUS_OK;
}

Status set_strings(Instance *instance, const char *function, const uint32_t vr[], size_t n, const char *const values[],
                   size_t n_values) {
    if (!may_set(instance, function, STRING, vr, n, values, n_values)) return STATUS_ERROR;
    for (size_t i = 0; i < n; i++) {
        const char *name = name_of(instance, variable_of(instance, vr[i]));
        if (!given(instance, function, values[i], name)) return STATUS_ERROR;
        if (!is_utf8(values[i])) return refuse(instance, function, "the value for '%s' is not UTF-8", name);
    }
    if (n > 0) instance->outputs_stale = true;
    for (size_t i = 0; i < n; i++)
        if (slave_set_string(instance, function, variable_of(instance, vr[i])->offset, values[i]) != STATUS_OK)
            return STATUS_ERROR;
    return STATUS_OK;
}

static void describe_bad(const Instance *instance, size_t at, Text *description) {
    for (size_t i = 0; i < instance->n_variables; i++) {
        const Variable *v = &instance->variables[i];
        if (v->kind != FLOAT64 || at < v->offset || at >= (size_t)v->offset + v->count) continue;
        text_add(description, "%s '%s' is %g", v->causality == OUTPUT ? "output" : "input", name_of(instance, v), instance->floats[at]);
        if (v->count > 1) text_add(description, " (entry %zu of %u)", at - v->offset + 1, v->count);
        return;
    }
}

bool find_not_finite(const Instance *instance, size_t first, size_t n, Text *description) {
    for (size_t i = first; i < first + n; i++) {
        if (isfinite(instance->floats[i])) continue;
        describe_bad(instance, i, description);
        return true;
    }
    return false;
}
