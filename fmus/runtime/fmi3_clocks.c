/* FMI 3.0: the clock of a sampled unit, a periodic input clock of constant interval that ticks first at the start.
 *
 * Its value reference follows those of all other variables (fmus/contents/fmi3_description.py).
 */
#include "fmi.h"
#include "log.h"
#include "sampling.h"

#define NO_CLOCKS "this unit has no clocks"
#define REFERENCES const fmi3ValueReference vr[], size_t n

/* Whether the references are all the clock's, and the function may be called now. */
static bool clocks(const Instance *instance, const char *function, unsigned modes, REFERENCES, const void *values) {
    if (!instance) return false;
    if (!has_clock(instance)) {
        refuse_unsupported(instance, function, NO_CLOCKS);
        return false;
    }
    if (!allowed(instance, function, modes)) return false;
    if (n > 0 && (!given(instance, function, vr, "valueReferences") || !given(instance, function, values, "values")))
        return false;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == instance->n_variables) continue;
        refuse(instance, function, "value reference %u is not that of a clock; the unit's one clock has %zu", vr[i],
               instance->n_variables);
        return false;
    }
    return true;
}

fmi3Status fmi3GetClock(fmi3Instance handle, REFERENCES, fmi3Clock values[]) {
    Instance *instance = handle;
    if (!clocks(instance, __func__, EVENT, vr, n, values)) return fmi3Error;
    for (size_t i = 0; i < n; i++) values[i] = instance->events.clock_active;
    return fmi3OK;
}

fmi3Status fmi3SetClock(fmi3Instance handle, REFERENCES, const fmi3Clock values[]) {
    Instance *instance = handle;
    if (!clocks(instance, __func__, EVENT, vr, n, values)) return fmi3Error;
    const uint8_t *bytes = (const uint8_t *)values; /* a host's true may be any bit pattern */
    for (size_t i = 0; i < n; i++) {
        if (!bytes[i] && instance->events.clock_active)
            return (fmi3Status)refuse(instance, __func__,
                                      "the clock cannot be deactivated; fmi3UpdateDiscreteStates ends its tick");
        if (bytes[i] && sampling_activate(instance, __func__) != STATUS_OK) return fmi3Error;
    }
    return fmi3OK;
}

/* Of a constant clock the standard knows one qualifier: the interval is as the model description says. */

fmi3Status fmi3GetIntervalDecimal(fmi3Instance handle, REFERENCES, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
    Instance *instance = handle;
    if (!clocks(instance, __func__, INITIALISATION | EVENT, vr, n, intervals) ||
        (n > 0 && !given(instance, __func__, qualifiers, "qualifiers")))
        return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        intervals[i] = period(instance);
        qualifiers[i] = fmi3IntervalUnchanged;
    }
    return fmi3OK;
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance handle, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                   fmi3IntervalQualifier qualifiers[]) {
    Instance *instance = handle;
    if (!clocks(instance, __func__, INITIALISATION | EVENT, vr, n, counters) ||
        (n > 0 && (!given(instance, __func__, resolutions, "resolutions") ||
                   !given(instance, __func__, qualifiers, "qualifiers"))))
        return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        counters[i] = instance->period_counter;
        resolutions[i] = instance->period_resolution;
        qualifiers[i] = fmi3IntervalUnchanged;
    }
    return fmi3OK;
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance handle, REFERENCES, fmi3Float64 shifts[]) {
    if (!clocks(handle, __func__, INITIALISATION | EVENT, vr, n, shifts)) return fmi3Error;
    for (size_t i = 0; i < n; i++) shifts[i] = 0.0;
    return fmi3OK;
}

fmi3Status fmi3GetShiftFraction(fmi3Instance handle, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]) {
    Instance *instance = handle;
    if (!clocks(instance, __func__, INITIALISATION | EVENT, vr, n, counters) ||
        (n > 0 && !given(instance, __func__, resolutions, "resolutions")))
        return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        counters[i] = 0;
        resolutions[i] = instance->period_resolution;
    }
    return fmi3OK;
}

static fmi3Status refuse_change(const Instance *instance, const char *function, const char *what) {
    if (!instance) return fmi3Error;
    if (!has_clock(instance)) return (fmi3Status)refuse_unsupported(instance, function, NO_CLOCKS);
    return (fmi3Status)refuse(instance, function, "the clock's %s is constant (intervalVariability), it cannot be set",
                              what);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance handle, REFERENCES, const fmi3Float64 intervals[]) {
    return refuse_change(handle, __func__, "interval");
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance handle, REFERENCES, const fmi3UInt64 counters[],
                                   const fmi3UInt64 resolutions[]) {
    return refuse_change(handle, __func__, "interval");
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance handle, REFERENCES, const fmi3Float64 shifts[]) {
    return refuse_change(handle, __func__, "shift");
}

fmi3Status fmi3SetShiftFraction(fmi3Instance handle, REFERENCES, const fmi3UInt64 counters[],
                                const fmi3UInt64 resolutions[]) {
    return refuse_change(handle, __func__, "shift");
}
