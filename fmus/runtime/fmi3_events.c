/* FMI 3.0: event mode. */
#include <math.h>

#include "fmi.h"
#include "log.h"
#include "stepping.h"

#define BEGIN(modes)             \
    Instance *instance = handle; \
    if (!allowed(instance, __func__, modes)) return fmi3Error

fmi3Status fmi3EnterEventMode(fmi3Instance handle) {
    BEGIN(STEPPING);
    return (fmi3Status)events_enter(instance, __func__);
}

fmi3Status fmi3EnterStepMode(fmi3Instance handle) {
    BEGIN(EVENT);
    return (fmi3Status)events_leave(instance, __func__);
}

/* Nothing to do: discrete states are evaluated when an output is read. */
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance handle) {
    BEGIN(INITIALISATION | EVENT);
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance handle, fmi3Boolean *again, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *states_changed,
                                    fmi3Boolean *next_event_defined, fmi3Float64 *next_event) {
    BEGIN(EVENT);
    if (!given(instance, __func__, again, "discreteStatesNeedUpdate") ||
        !given(instance, __func__, terminate, "terminateSimulation") ||
        !given(instance, __func__, nominals_changed, "nominalsOfContinuousStatesChanged") ||
        !given(instance, __func__, states_changed, "valuesOfContinuousStatesChanged") ||
        !given(instance, __func__, next_event_defined, "nextEventTimeDefined") ||
        !given(instance, __func__, next_event, "nextEventTime"))
        return fmi3Error;
    *again = *terminate = *nominals_changed = *states_changed = *next_event_defined = false;
    *next_event = 0.0;
    double next;
    if (events_update(instance, __func__, &next) != STATUS_OK) return fmi3Error;
    *next_event_defined = isfinite(next);
    if (*next_event_defined) *next_event = next;
    return fmi3OK;
}
