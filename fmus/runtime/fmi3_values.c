/* FMI 3.0: getting and setting variables. Those of a unit are Float64, Int64, Boolean, String, Binary, Enumeration. */
#include <string.h>

#include "fmi.h"
#include "instance.h"

typedef const fmi3ValueReference References[];

fmi3Status fmi3GetFloat64(fmi3Instance handle, References vr, size_t n, fmi3Float64 values[], size_t n_values) {
    return (fmi3Status)get_floats(handle, __func__, vr, n, values, n_values);
}

fmi3Status fmi3SetFloat64(fmi3Instance handle, References vr, size_t n, const fmi3Float64 values[], size_t n_values) {
    return (fmi3Status)set_floats(handle, __func__, vr, n, values, n_values);
}

fmi3Status fmi3GetInt64(fmi3Instance handle, References vr, size_t n, fmi3Int64 values[], size_t n_values) {
    Instance *instance = handle;
    if (!may_get(instance, __func__, INT64, vr, n, values, n_values)) return fmi3Error;
    for (size_t i = 0; i < n; i++) values[i] = instance->integers[variable_of(instance, vr[i])->offset];
    return fmi3OK;
}

fmi3Status fmi3SetInt64(fmi3Instance handle, References vr, size_t n, const fmi3Int64 values[], size_t n_values) {
    Instance *instance = handle;
    if (!may_set(instance, __func__, INT64, vr, n, values, n_values)) return fmi3Error;
    for (size_t i = 0; i < n; i++) instance->integers[variable_of(instance, vr[i])->offset] = values[i];
    return fmi3OK;
}

fmi3Status fmi3GetBoolean(fmi3Instance handle, References vr, size_t n, fmi3Boolean values[], size_t n_values) {
    Instance *instance = handle;
    if (!may_get(instance, __func__, BOOLEAN, vr, n, values, n_values)) return fmi3Error;
    for (size_t i = 0; i < n; i++) values[i] = instance->booleans[variable_of(instance, vr[i])->offset] != 0;
    return fmi3OK;
}

fmi3Status fmi3SetBoolean(fmi3Instance handle, References vr, size_t n, const fmi3Boolean values[], size_t n_values) {
    Instance *instance = handle;
    if (!may_set(instance, __func__, BOOLEAN, vr, n, values, n_values)) return fmi3Error;
    const uint8_t *bytes = (const uint8_t *)values; /* a host's true may be any bit pattern */
    for (size_t i = 0; i < n; i++) instance->booleans[variable_of(instance, vr[i])->offset] = bytes[i] != 0;
    return fmi3OK;
}

fmi3Status fmi3GetString(fmi3Instance handle, References vr, size_t n, fmi3String values[], size_t n_values) {
    return (fmi3Status)get_strings(handle, __func__, vr, n, values, n_values);
}

fmi3Status fmi3SetString(fmi3Instance handle, References vr, size_t n, const fmi3String values[], size_t n_values) {
    return (fmi3Status)set_strings(handle, __func__, vr, n, values, n_values);
}

/* The pointers lead into the instance's own buffers: nothing is copied. */
fmi3Status fmi3GetBinary(fmi3Instance handle, References vr, size_t n, size_t sizes[], fmi3Binary values[],
                         size_t n_values) {
    Instance *instance = handle;
    if (n > 0 && !given(instance, __func__, sizes, "valueSizes")) return fmi3Error;
    if (!may_get(instance, __func__, BINARY, vr, n, values, n_values)) return fmi3Error;
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
    const char *name = instance->names + variable->name;
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
    if (!may_set(instance, __func__, BINARY, vr, n, values, n_values)) return fmi3Error;
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

#define NO_SUCH_TYPE(Type)                                                                                             \
    fmi3Status fmi3Get##Type(fmi3Instance handle, References vr, size_t n, fmi3##Type values[], size_t n_values) {     \
        (void)vr, (void)values, (void)n_values;                                                                        \
        return n == 0 && handle ? fmi3OK : (fmi3Status)refuse_unsupported(handle, __func__, "no variable is " #Type);  \
    }                                                                                                                  \
    fmi3Status fmi3Set##Type(fmi3Instance handle, References vr, size_t n, const fmi3##Type values[],                  \
                             size_t n_values) {                                                                        \
        (void)vr, (void)values, (void)n_values;                                                                        \
        return n == 0 && handle ? fmi3OK : (fmi3Status)refuse_unsupported(handle, __func__, "no variable is " #Type);  \
    }
NO_SUCH_TYPE(Float32)
NO_SUCH_TYPE(Int8)
NO_SUCH_TYPE(UInt8)
NO_SUCH_TYPE(Int16)
NO_SUCH_TYPE(UInt16)
NO_SUCH_TYPE(Int32)
NO_SUCH_TYPE(UInt32)
NO_SUCH_TYPE(UInt64)
