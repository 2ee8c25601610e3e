/* FMI 3.0: functions that a unit does not support. They exist, as hosts look up every name, and return an error. */
#include "fmi.h"
#include "log.h"

#define CONFIGURATION "this unit has no structural parameters"
#define DEPENDENCIES "the dependencies do not change, see ModelStructure in modelDescription.xml"
#define DERIVATIVES "derivatives of outputs with respect to time are not provided"
#define MODEL_EXCHANGE "this unit is a co-simulation slave, it has no model-exchange form"
#define SCHEDULED "this unit is a co-simulation slave, it has no scheduled-execution form"

#define UNSUPPORTED(reason, function, ...)                                     \
    fmi3Status function(fmi3Instance handle, __VA_ARGS__) {                    \
        return (fmi3Status)refuse_unsupported(handle, __func__, reason);       \
    }
#define UNSUPPORTED_BARE(reason, function)                                     \
    fmi3Status function(fmi3Instance handle) {                                 \
        return (fmi3Status)refuse_unsupported(handle, __func__, reason);       \
    }
#define REFERENCES const fmi3ValueReference vr[], size_t n

UNSUPPORTED_BARE(CONFIGURATION, fmi3EnterConfigurationMode)
UNSUPPORTED_BARE(CONFIGURATION, fmi3ExitConfigurationMode)

UNSUPPORTED(DEPENDENCIES, fmi3GetNumberOfVariableDependencies, fmi3ValueReference vr, size_t *n)
UNSUPPORTED(DEPENDENCIES, fmi3GetVariableDependencies, fmi3ValueReference dependent, size_t dependent_entries[],
            fmi3ValueReference independents[], size_t independent_entries[], fmi3DependencyKind kinds[], size_t n)

UNSUPPORTED(DERIVATIVES, fmi3GetOutputDerivatives, REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[],
            size_t n_values)

UNSUPPORTED_BARE(MODEL_EXCHANGE, fmi3EnterContinuousTimeMode)
UNSUPPORTED(MODEL_EXCHANGE, fmi3CompletedIntegratorStep, fmi3Boolean no_set_state_prior, fmi3Boolean *event,
            fmi3Boolean *terminate)
UNSUPPORTED(MODEL_EXCHANGE, fmi3SetTime, fmi3Float64 t)
UNSUPPORTED(MODEL_EXCHANGE, fmi3SetContinuousStates, const fmi3Float64 x[], size_t n)
UNSUPPORTED(MODEL_EXCHANGE, fmi3GetContinuousStateDerivatives, fmi3Float64 x[], size_t n)
UNSUPPORTED(MODEL_EXCHANGE, fmi3GetEventIndicators, fmi3Float64 z[], size_t n)
UNSUPPORTED(MODEL_EXCHANGE, fmi3GetContinuousStates, fmi3Float64 x[], size_t n)
UNSUPPORTED(MODEL_EXCHANGE, fmi3GetNominalsOfContinuousStates, fmi3Float64 x[], size_t n)
UNSUPPORTED(MODEL_EXCHANGE, fmi3GetNumberOfEventIndicators, size_t *n)
UNSUPPORTED(MODEL_EXCHANGE, fmi3GetNumberOfContinuousStates, size_t *n)

UNSUPPORTED(SCHEDULED, fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 time)
