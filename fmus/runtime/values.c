/* Getting and setting variables: what is allowed in which mode, and the kinds that both standards treat alike. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "lifecycle.h"
#include "log.h"
#include "slave.h"
#include "text.h"
#include "values.h"
#include "variables.h"

static const char *kind_name(unsigned kind) {
    static const char *const names[] = {"a real", "an integer or enumeration", "a boolean", "a string", "a binary"};
    return kind < sizeof names / sizeof *names ? names[kind] : "of no kind";
}

static const char *type_name(unsigned type) {
    static const char *const names[] = {"no type", "Float64", "Float32", "Int8",   "UInt8",
                                        "Int16",   "UInt16",  "Int32",   "UInt32", "Int64",
                                        "UInt64",  "Enumeration", "Boolean", "String", "Binary"};
    return type < sizeof names / sizeof *names ? names[type] : names[ANY_TYPE];
}

/* In FMI 3 enumerations are read and written as Int64. */
static bool is_of(const Variable *variable, Kind kind, Type type) {
    return variable->kind == kind && (type == ANY_TYPE || variable->type == type ||
                                      (type == TYPE_INT64 && variable->type == TYPE_ENUMERATION));
}

static bool known(const Instance *instance, const char *function, Kind kind, Type type, uint32_t reference) {
    if (reference >= instance->n_variables) {
        refuse(instance, function, "there is no variable with value reference %u", reference);
        return false;
    }
    const Variable *variable = variable_of(instance, reference);
    if (is_of(variable, kind, type)) return true;
    if (type == ANY_TYPE)
        refuse(instance, function, "'%s' (value reference %u) is %s variable", name_of(instance, variable), reference,
               kind_name(variable->kind));
    else
        refuse(instance, function, "'%s' (value reference %u) is of type %s", name_of(instance, variable), reference,
               type_name(variable->type));
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

bool may_get(Instance *instance, const char *function, Kind kind, Type type, const uint32_t references[], size_t n,
             const void *values, size_t n_values) {
    if (!allowed(instance, function, ANY_MODE)) return false;
    if (n > 0 && !given(instance, function, references, "valueReferences")) return false;
    size_t count = 0;
    bool outputs = false;
    for (size_t i = 0; i < n; i++) {
        if (!known(instance, function, kind, type, references[i])) return false;
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

bool may_set(Instance *instance, const char *function, Kind kind, Type type, const uint32_t references[], size_t n,
             const void *values, size_t n_values) {
    if (!allowed(instance, function, INSTANTIATED | INITIALISATION | STEPPING | EVENT)) return false;
    if (n > 0 && !given(instance, function, references, "valueReferences")) return false;
    size_t count = 0;
    for (size_t i = 0; i < n; i++) {
        if (!known(instance, function, kind, type, references[i])) return false;
        const Variable *variable = variable_of(instance, references[i]);
        if (!settable(instance, function, variable)) return false;
        count += variable->count;
    }
    if (!counted(instance, function, count, values, n_values)) return false;
    bool may_yet_be_refused = kind == STRING || kind == BINARY; /* value by value, by the caller */
    if (n > 0 && !may_yet_be_refused) instance->outputs_stale = true;
    return true;
}

bool takes_integer(const Instance *instance, const char *function, uint32_t reference, int64_t number) {
    static const struct {
        int64_t lowest, highest;
    } ranges[] = {[TYPE_INT8] = {INT8_MIN, INT8_MAX},    [TYPE_UINT8] = {0, UINT8_MAX},
                  [TYPE_INT16] = {INT16_MIN, INT16_MAX}, [TYPE_UINT16] = {0, UINT16_MAX},
                  [TYPE_INT32] = {INT32_MIN, INT32_MAX}, [TYPE_UINT32] = {0, UINT32_MAX},
                  [TYPE_INT64] = {INT64_MIN, INT64_MAX}, [TYPE_UINT64] = {0, INT64_MAX}};
    const Variable *variable = variable_of(instance, reference);
    if (variable->type < TYPE_INT8 || variable->type > TYPE_UINT64) return true; /* an enumeration */
    int64_t lowest = ranges[variable->type].lowest, highest = ranges[variable->type].highest;
    if (lowest <= number && number <= highest) return true;
    refuse(instance, function, "'%s' (value reference %u) takes %s, from %lld to %lld, not %lld",
           name_of(instance, variable), reference, type_name(variable->type), (long long)lowest, (long long)highest,
           (long long)number);
    return false;
}

Status get_floats(Instance *instance, const char *function, Type type, const uint32_t vr[], size_t n, double values[],
                  size_t n_values) {
    if (!may_get(instance, function, FLOAT64, type, vr, n, values, n_values)) return STATUS_ERROR;
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = variable_of(instance, vr[i]);
        memcpy(values, instance->floats + variable->offset, variable->count * sizeof *values);
        values += variable->count;
    }
    return STATUS_OK;
}

Status set_floats(Instance *instance, const char *function, Type type, const uint32_t vr[], size_t n,
                  const double values[], size_t n_values) {
    if (!may_set(instance, function, FLOAT64, type, vr, n, values, n_values)) return STATUS_ERROR;
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = variable_of(instance, vr[i]);
        memcpy(instance->floats + variable->offset, values, variable->count * sizeof *values);
        values += variable->count;
    }
    return STATUS_OK;
}

static bool fits_single(const Instance *instance, const char *function, const Variable *variable, double value) {
    if (!isfinite(value) || fabs(value) <= FLT_MAX) return true;
    refuse(instance, function, "the value %g of '%s' is beyond Float32", value, name_of(instance, variable));
    return false;
}

Status get_singles(Instance *instance, const char *function, const uint32_t vr[], size_t n, float values[],
                   size_t n_values) {
    if (!may_get(instance, function, FLOAT64, TYPE_FLOAT32, vr, n, values, n_values)) return STATUS_ERROR;
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = variable_of(instance, vr[i]);
        for (size_t k = variable->offset; k < (size_t)variable->offset + variable->count; k++) {
            if (!fits_single(instance, function, variable, instance->floats[k])) return STATUS_ERROR;
            *values++ = (float)instance->floats[k];
        }
    }
    return STATUS_OK;
}

Status set_singles(Instance *instance, const char *function, const uint32_t vr[], size_t n, const float values[],
                   size_t n_values) {
    if (!may_set(instance, function, FLOAT64, TYPE_FLOAT32, vr, n, values, n_values)) return STATUS_ERROR;
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = variable_of(instance, vr[i]);
        for (size_t k = 0; k < variable->count; k++) instance->floats[variable->offset + k] = *values++;
    }
    return STATUS_OK;
}

Status get_strings(Instance *instance, const char *function, Type type, const uint32_t vr[], size_t n,
                   const char *values[], size_t n_values) {
    if (!may_get(instance, function, STRING, type, vr, n, values, n_values)) return STATUS_ERROR;
    for (size_t i = 0; i < n; i++)
        if (slave_get_string(instance, function, variable_of(instance, vr[i])->offset, &values[i]) != STATUS_OK)
            return STATUS_ERROR;
    return STATUS_OK;
}

Status set_strings(Instance *instance, const char *function, Type type, const uint32_t vr[], size_t n,
                   const char *const values[], size_t n_values) {
    if (!may_set(instance, function, STRING, type, vr, n, values, n_values)) return STATUS_ERROR;
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
