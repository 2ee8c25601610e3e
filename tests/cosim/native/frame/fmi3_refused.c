/* What FMI 3.0 wants exported and these units have no use for. */
#include "fmi3Functions.h"

#define REFUSED(name, ...)                                                                                             \
    fmi3Status name(fmi3Instance c, ##__VA_ARGS__) { return fmi3Error; }
#define REFERENCES const fmi3ValueReference vr[], size_t n

#define NO_ACCESS(Type)                                                                                                \
    REFUSED(fmi3Get##Type, REFERENCES, fmi3##Type values[], size_t n_values)                                           \
    REFUSED(fmi3Set##Type, REFERENCES, const fmi3##Type values[], size_t n_values)
NO_ACCESS(Float32)
NO_ACCESS(Int8)
NO_ACCESS(UInt8)
NO_ACCESS(Int16)
NO_ACCESS(UInt16)
NO_ACCESS(UInt32)
NO_ACCESS(Int64)
NO_ACCESS(UInt64)
NO_ACCESS(String)

REFUSED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference vr, size_t *n)
REFUSED(fmi3GetVariableDependencies, fmi3ValueReference vr, size_t elements[], fmi3ValueReference known[],
        size_t known_elements[], fmi3DependencyKind kinds[], size_t n)
REFUSED(fmi3GetAdjointDerivative, const fmi3ValueReference unknown[], size_t n, const fmi3ValueReference known[],
        size_t m, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 change[], size_t n_change)
REFUSED(fmi3EnterConfigurationMode)
REFUSED(fmi3ExitConfigurationMode)
REFUSED(fmi3SetIntervalDecimal, REFERENCES, const fmi3Float64 intervals[])
REFUSED(fmi3SetIntervalFraction, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
REFUSED(fmi3SetShiftDecimal, REFERENCES, const fmi3Float64 shifts[])
REFUSED(fmi3SetShiftFraction, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
REFUSED(fmi3GetOutputDerivatives, REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t n_values)

/* model exchange and scheduled execution */
REFUSED(fmi3EnterContinuousTimeMode)
REFUSED(fmi3CompletedIntegratorStep, fmi3Boolean no_rollback, fmi3Boolean *event, fmi3Boolean *terminate)
REFUSED(fmi3SetTime, fmi3Float64 time)
REFUSED(fmi3SetContinuousStates, const fmi3Float64 states[], size_t n)
REFUSED(fmi3GetContinuousStateDerivatives, fmi3Float64 derivatives[], size_t n)
REFUSED(fmi3GetEventIndicators, fmi3Float64 indicators[], size_t n)
REFUSED(fmi3GetContinuousStates, fmi3Float64 states[], size_t n)
REFUSED(fmi3GetNominalsOfContinuousStates, fmi3Float64 nominals[], size_t n)
REFUSED(fmi3GetNumberOfEventIndicators, size_t *n)
REFUSED(fmi3GetNumberOfContinuousStates, size_t *n)
REFUSED(fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 time)

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback logger) {
    return NULL;
}
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    return NULL;
}
