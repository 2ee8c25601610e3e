/* Variables read and written for the host. */
#ifndef VALUES_H
#define VALUES_H

#include "instance.h"

/* Whether these variables may be read (written) now and have `values` entries altogether. Reading brings outputs up to
 * date, writing marks them stale. */
bool may_get(Instance *instance, const char *function, Kind kind, Type type, const uint32_t references[], size_t n,
             const void *values, size_t n_values);
bool may_set(Instance *instance, const char *function, Kind kind, Type type, const uint32_t references[], size_t n,
             const void *values, size_t n_values);

/* Whether an integer variable takes a number. */
bool takes_integer(const Instance *instance, const char *function, uint32_t reference, int64_t number);

Status get_floats(Instance *instance, const char *function, Type type, const uint32_t vr[], size_t n, double values[],
                  size_t);
Status set_floats(Instance *instance, const char *function, Type type, const uint32_t vr[], size_t n,
                  const double values[], size_t);
Status get_singles(Instance *instance, const char *function, const uint32_t vr[], size_t n, float values[], size_t);
Status set_singles(Instance *instance, const char *function, const uint32_t vr[], size_t n, const float values[],
                   size_t);
Status get_strings(Instance *instance, const char *function, Type type, const uint32_t vr[], size_t n,
                   const char *values[], size_t);
Status set_strings(Instance *instance, const char *function, Type type, const uint32_t vr[], size_t n,
                   const char *const values[], size_t);

#endif
