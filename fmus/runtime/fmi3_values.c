/* FMI 3.0: getting and setting variables. Reals are doubles inside, integers int64: widths matter here only. */
#include <string.h>

#include "fmi.h"
#include "log.h"
#include "values.h"
#include "variables.h"

typedef const fmi3ValueReference References[];

fmi3Status fmi3GetFloat64(fmi3Instance handle, References vr, size_t n, fmi3Float64 values[], size_t n_values) {
    return (fmi3Status)get_floats(handle, __func__, TYPE_FLOAT64, vr, n, values, n_values);
}

fmi3Status fmi3SetFloat64(fmi3Instance handle, References vr, size_t n, const fmi3Float64 values[], size_t n_values) {
    return (fmi3Status)set_floats(handle, __func__, TYPE_FLOAT64, vr, n, values, n_values);
}

fmi3Status fmi3GetFloat32(fmi3Instance handle, References vr, size_t n, fmi3Float32 values[], size_t n_values) {
    return (fmi3Status)get_singles(handle, __func__, vr, n, values, n_values);
}

fmi3Status fmi3SetFloat32(fmi3Instance handle, References vr, size_t n, const fmi3Float32 values[], size_t n_values) {
    return (fmi3Status)set_singles(handle, __func__, vr, n, values, n_values);
}

static bool kept(const Instance *instance, const char *function, uint32_t reference, int64_t number,
                 int64_t as_told) {
    if (number == as_told) return true;
    const Variable *variable = variable_of(instance, reference);
    refuse(instance, function, "the value %lld of '%s' (value reference %u) does not fit its type", (long long)number,
           name_of(instance, variable), reference);
    return false;
}

/* The buffer's int64 are within the block's width, but the scalar form may declare fewer bits. UInt64 keeps its 64. */
#define INTEGER(Name, TYPE)                                                                                            \
    fmi3Status fmi3Get##Name(fmi3Instance handle, References vr, size_t n, fmi3##Name values[], size_t n_values) {     \
        Instance *instance = handle;                                                                                   \
        if (!may_get(instance, __func__, INT64, TYPE, vr, n, values, n_values)) return fmi3Error;                      \
        for (size_t i = 0; i < n; i++) {                                                                               \
            int64_t number = instance->integers[variable_of(instance, vr[i])->offset];                                 \
            values[i] = (fmi3##Name)number;                                                                            \
            if (!kept(instance, __func__, vr[i], number, (int64_t)values[i])) return fmi3Error;                        \
        }                                                                                                              \
        return fmi3OK;                                                                                                 \
    }                                                                                                                  \
    fmi3Status fmi3Set##Name(fmi3Instance handle, References vr, size_t n, const fmi3##Name values[],                  \
                             size_t n_values) {                                                                        \
        Instance *instance = handle;                                                                                   \
        if (!may_set(instance, __func__, INT64, TYPE, vr, n, values, n_values)) return fmi3Error;                      \
        for (size_t i = 0; i < n; i++)                                                                                 \
            instance->integers[variable_of(instance, vr[i])->offset] = (int64_t)values[i];                             \
        return fmi3OK;                                                                                                 \
    }
INTEGER(Int8, TYPE_INT8)
INTEGER(UInt8, TYPE_UINT8)
INTEGER(Int16, TYPE_INT16)
INTEGER(UInt16, TYPE_UINT16)
INTEGER(Int32, TYPE_INT32)
INTEGER(UInt32, TYPE_UINT32)
INTEGER(Int64, TYPE_INT64) /* enumerations too */
INTEGER(UInt64, TYPE_UINT64)

fmi3Status fmi3GetBoolean(fmi3Instance handle, References vr, size_t n, fmi3Boolean values[], size_t n_values) {
    Instance *instance = handle;
    if (!may_get(instance, __func__, BOOLEAN, TYPE_BOOLEAN, vr, n, values, n_values)) return fmi3Error;
    for (size_t i = 0; i < n; i++) values[i] = instance->booleans[variable_of(instance, vr[i])->offset] != 0;
    return fmi3OK;
}

fmi3Status fmi3SetBoolean(fmi3Instance handle, References vr, size_t n, const fmi3Boolean values[], size_t n_values) {
    Instance *instance = handle;
    if (!may_set(instance, __func__, BOOLEAN, TYPE_BOOLEAN, vr, n, values, n_values)) return fmi3Error;
    const uint8_t *bytes = (const uint8_t *)values; /* a host's true may be any bit pattern */
    for (size_t i = 0; i < n; i++) instance->booleans[variable_of(instance, vr[i])->offset] = bytes[i] != 0;
    return fmi3OK;
}

fmi3Status fmi3GetString(fmi3Instance handle, References vr, size_t n, fmi3String values[], size_t n_values) {
    return (fmi3Status)get_strings(handle, __func__, TYPE_STRING, vr, n, values, n_values);
}

fmi3Status fmi3SetString(fmi3Instance handle, References vr, size_t n, const fmi3String values[], size_t n_values) {
    return (fmi3Status)set_strings(handle, __func__, TYPE_STRING, vr, n, values, n_values);
}

/* The pointers are into the instance's own buffers: nothing is copied. */
fmi3Status fmi3GetBinary(fmi3Instance handle, References vr, size_t n, size_t sizes[], fmi3Binary values[],
                         size_t n_values) {
    Instance *instance = handle;
    if (n > 0 && !given(instance, __func__, sizes, "valueSizes")) return fmi3Error;
    if (!may_get(instance, __func__, BINARY, TYPE_BINARY, vr, n, values, n_values)) return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        uint32_t index = variable_of(instance, vr[i])->offset;
        values[i] = (fmi3Binary)(uintptr_t)instance->binaries[index].address;
        sizes[i] = instance->sizes[index];
    }
    return fmi3OK;
}

static bool fits(const Instance *instance, const char *function, const Variable *variable, size_t size,
                 fmi3Binary value) {
    const BinaryBuffer *buffer = &instance->binaries[variable->offset];
    const char *name = name_of(instance, variable);
    if (size > 0 && !given(instance, function, value, name)) return false;
    if (size == 0 || size == buffer->capacity || (!buffer->exact && size < buffer->capacity)) return true;
    refuse(instance, function, "%zu bytes for '%s', which takes %s%llu", size, name, buffer->exact ? "" : "at most ",
           (unsigned long long)buffer->capacity);
    return false;
}

/* No bytes for a picture make it black, as it is at the start. */
fmi3Status fmi3SetBinary(fmi3Instance handle, References vr, size_t n, const size_t sizes[], const fmi3Binary values[],
                         size_t n_values) {
    Instance *instance = handle;
    if (!may_set(instance, __func__, BINARY, TYPE_BINARY, vr, n, values, n_values)) return fmi3Error;
    if (n > 0 && !given(instance, __func__, sizes, "valueSizes")) return fmi3Error;
    for (size_t i = 0; i < n; i++)
        if (!fits(instance, __func__, variable_of(instance, vr[i]), sizes[i], values[i])) return fmi3Error;
    if (n > 0) instance->outputs_stale = true;
    for (size_t i = 0; i < n; i++) {
        uint32_t index = variable_of(instance, vr[i])->offset;
        const BinaryBuffer *buffer = &instance->binaries[index];
        void *to = (void *)(uintptr_t)buffer->address;
        if (sizes[i] > 0)
            memcpy(to, values[i], sizes[i]);
        else if (buffer->exact)
            memset(to, 0, buffer->capacity);
        instance->sizes[index] = buffer->exact ? buffer->capacity : sizes[i];
    }
    return fmi3OK;
}
