/* Types and functions of FMI 2.0 and FMI 3.0, as far as a slave exports them.
 *
 * A test compiles these declarations together with the standards' own headers, so a difference is a compiler's error.
 * Define FMI_TYPES_GIVEN to leave the types out and declare the functions only.
 */
#ifndef FMI_H
#define FMI_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define FMI_EXPORT __declspec(dllexport)
#else
#define FMI_EXPORT __attribute__((visibility("default")))
#endif

#ifndef FMI_TYPES_GIVEN

/* FMI 2.0 */

typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;

typedef void (*fmi2CallbackLogger)(fmi2ComponentEnvironment, fmi2String instanceName, fmi2Status, fmi2String category,
                                   fmi2String message, ...);
typedef void *(*fmi2CallbackAllocateMemory)(size_t, size_t);
typedef void (*fmi2CallbackFreeMemory)(void *);
typedef void (*fmi2StepFinished)(fmi2ComponentEnvironment, fmi2Status);

typedef struct {
    fmi2CallbackLogger logger;
    fmi2CallbackAllocateMemory allocateMemory;
    fmi2CallbackFreeMemory freeMemory;
    fmi2StepFinished stepFinished;
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

typedef struct {
    fmi2Boolean newDiscreteStatesNeeded;
    fmi2Boolean terminateSimulation;
    fmi2Boolean nominalsOfContinuousStatesChanged;
    fmi2Boolean valuesOfContinuousStatesChanged;
    fmi2Boolean nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;

/* FMI 3.0 */

typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean;
typedef char fmi3Char;
typedef const fmi3Char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Clock;

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;

typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String category, fmi3String message);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64 intermediateUpdateTime,
                                               fmi3Boolean intermediateVariableSetRequested,
                                               fmi3Boolean intermediateVariableGetAllowed,
                                               fmi3Boolean intermediateStepFinished, fmi3Boolean canReturnEarly,
                                               fmi3Boolean *earlyReturnRequested, fmi3Float64 *earlyReturnTime);
typedef void (*fmi3LockPreemptionCallback)();
typedef void (*fmi3UnlockPreemptionCallback)();

#endif

/* FMI 2.0: both kinds */

FMI_EXPORT const char *fmi2GetTypesPlatform(void);
FMI_EXPORT const char *fmi2GetVersion(void);
FMI_EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component, fmi2Boolean loggingOn, size_t, const fmi2String categories[]);
FMI_EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type, fmi2String guid, fmi2String resourceLocation,
                                         const fmi2CallbackFunctions *, fmi2Boolean visible, fmi2Boolean loggingOn);
FMI_EXPORT void fmi2FreeInstance(fmi2Component);
FMI_EXPORT fmi2Status fmi2SetupExperiment(fmi2Component, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                                          fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime);
FMI_EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component);
FMI_EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component);
FMI_EXPORT fmi2Status fmi2Terminate(fmi2Component);
FMI_EXPORT fmi2Status fmi2Reset(fmi2Component);

#define FMI2_GET_AND_SET(Type)                                                                                         \
    FMI_EXPORT fmi2Status fmi2Get##Type(fmi2Component, const fmi2ValueReference[], size_t, fmi2##Type values[]);       \
    FMI_EXPORT fmi2Status fmi2Set##Type(fmi2Component, const fmi2ValueReference[], size_t, const fmi2##Type values[]);
FMI2_GET_AND_SET(Real)
FMI2_GET_AND_SET(Integer)
FMI2_GET_AND_SET(Boolean)
FMI2_GET_AND_SET(String)

FMI_EXPORT fmi2Status fmi2GetFMUstate(fmi2Component, fmi2FMUstate *);
FMI_EXPORT fmi2Status fmi2SetFMUstate(fmi2Component, fmi2FMUstate);
FMI_EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component, fmi2FMUstate *);
FMI_EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component, fmi2FMUstate, size_t *);
FMI_EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component, fmi2FMUstate, fmi2Byte[], size_t);
FMI_EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component, const fmi2Byte[], size_t, fmi2FMUstate *);
FMI_EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component, const fmi2ValueReference unknowns[], size_t,
                                                   const fmi2ValueReference knowns[], size_t, const fmi2Real seed[],
                                                   fmi2Real sensitivity[]);

/* FMI 2.0: model exchange */

FMI_EXPORT fmi2Status fmi2EnterEventMode(fmi2Component);
FMI_EXPORT fmi2Status fmi2NewDiscreteStates(fmi2Component, fmi2EventInfo *);
FMI_EXPORT fmi2Status fmi2EnterContinuousTimeMode(fmi2Component);
FMI_EXPORT fmi2Status fmi2CompletedIntegratorStep(fmi2Component, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                                  fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation);
FMI_EXPORT fmi2Status fmi2SetTime(fmi2Component, fmi2Real);
FMI_EXPORT fmi2Status fmi2SetContinuousStates(fmi2Component, const fmi2Real[], size_t);
FMI_EXPORT fmi2Status fmi2GetDerivatives(fmi2Component, fmi2Real[], size_t);
FMI_EXPORT fmi2Status fmi2GetEventIndicators(fmi2Component, fmi2Real[], size_t);
FMI_EXPORT fmi2Status fmi2GetContinuousStates(fmi2Component, fmi2Real[], size_t);
FMI_EXPORT fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component, fmi2Real[], size_t);

/* FMI 2.0: co-simulation */

FMI_EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component, const fmi2ValueReference[], size_t,
                                                  const fmi2Integer order[], const fmi2Real[]);
FMI_EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component, const fmi2ValueReference[], size_t,
                                                   const fmi2Integer order[], fmi2Real[]);
FMI_EXPORT fmi2Status fmi2DoStep(fmi2Component, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                                 fmi2Boolean noSetFMUStatePriorToCurrentPoint);
FMI_EXPORT fmi2Status fmi2CancelStep(fmi2Component);
FMI_EXPORT fmi2Status fmi2GetStatus(fmi2Component, const fmi2StatusKind, fmi2Status *);
FMI_EXPORT fmi2Status fmi2GetRealStatus(fmi2Component, const fmi2StatusKind, fmi2Real *);
FMI_EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component, const fmi2StatusKind, fmi2Integer *);
FMI_EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component, const fmi2StatusKind, fmi2Boolean *);
FMI_EXPORT fmi2Status fmi2GetStringStatus(fmi2Component, const fmi2StatusKind, fmi2String *);

/* FMI 3.0: all kinds */

FMI_EXPORT const char *fmi3GetVersion(void);
FMI_EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance, fmi3Boolean loggingOn, size_t, const fmi3String categories[]);
FMI_EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resourcePath,
                                                     fmi3Boolean visible, fmi3Boolean loggingOn,
                                                     fmi3InstanceEnvironment, fmi3LogMessageCallback);
FMI_EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resourcePath,
                                                    fmi3Boolean visible, fmi3Boolean loggingOn,
                                                    fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                                    const fmi3ValueReference requiredIntermediateVariables[], size_t,
                                                    fmi3InstanceEnvironment, fmi3LogMessageCallback,
                                                    fmi3IntermediateUpdateCallback);
FMI_EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resourcePath,
                                                          fmi3Boolean visible, fmi3Boolean loggingOn,
                                                          fmi3InstanceEnvironment, fmi3LogMessageCallback,
                                                          fmi3ClockUpdateCallback, fmi3LockPreemptionCallback,
                                                          fmi3UnlockPreemptionCallback);
FMI_EXPORT void fmi3FreeInstance(fmi3Instance);
FMI_EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                                  fmi3Float64 startTime, fmi3Boolean stopTimeDefined,
                                                  fmi3Float64 stopTime);
FMI_EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance);
FMI_EXPORT fmi3Status fmi3EnterEventMode(fmi3Instance);
FMI_EXPORT fmi3Status fmi3Terminate(fmi3Instance);
FMI_EXPORT fmi3Status fmi3Reset(fmi3Instance);

#define FMI3_GET_AND_SET(Type)                                                                                         \
    FMI_EXPORT fmi3Status fmi3Get##Type(fmi3Instance, const fmi3ValueReference[], size_t, fmi3##Type values[],         \
                                        size_t);                                                                       \
    FMI_EXPORT fmi3Status fmi3Set##Type(fmi3Instance, const fmi3ValueReference[], size_t, const fmi3##Type values[],   \
                                        size_t);
FMI3_GET_AND_SET(Float32)
FMI3_GET_AND_SET(Float64)
FMI3_GET_AND_SET(Int8)
FMI3_GET_AND_SET(UInt8)
FMI3_GET_AND_SET(Int16)
FMI3_GET_AND_SET(UInt16)
FMI3_GET_AND_SET(Int32)
FMI3_GET_AND_SET(UInt32)
FMI3_GET_AND_SET(Int64)
FMI3_GET_AND_SET(UInt64)
FMI3_GET_AND_SET(Boolean)
FMI3_GET_AND_SET(String)
FMI_EXPORT fmi3Status fmi3GetBinary(fmi3Instance, const fmi3ValueReference[], size_t, size_t sizes[],
                                    fmi3Binary values[], size_t);
FMI_EXPORT fmi3Status fmi3SetBinary(fmi3Instance, const fmi3ValueReference[], size_t, const size_t sizes[],
                                    const fmi3Binary values[], size_t);
FMI_EXPORT fmi3Status fmi3GetClock(fmi3Instance, const fmi3ValueReference[], size_t, fmi3Clock values[]);
FMI_EXPORT fmi3Status fmi3SetClock(fmi3Instance, const fmi3ValueReference[], size_t, const fmi3Clock values[]);

FMI_EXPORT fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance, fmi3ValueReference, size_t *);
FMI_EXPORT fmi3Status fmi3GetVariableDependencies(fmi3Instance, fmi3ValueReference dependent,
                                                  size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
                                                  size_t elementIndicesOfIndependents[], fmi3DependencyKind kinds[],
                                                  size_t);
FMI_EXPORT fmi3Status fmi3GetFMUState(fmi3Instance, fmi3FMUState *);
FMI_EXPORT fmi3Status fmi3SetFMUState(fmi3Instance, fmi3FMUState);
FMI_EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance, fmi3FMUState *);
FMI_EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance, fmi3FMUState, size_t *);
FMI_EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance, fmi3FMUState, fmi3Byte[], size_t);
FMI_EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance, const fmi3Byte[], size_t, fmi3FMUState *);
FMI_EXPORT fmi3Status fmi3GetDirectionalDerivative(fmi3Instance, const fmi3ValueReference unknowns[], size_t,
                                                   const fmi3ValueReference knowns[], size_t, const fmi3Float64 seed[],
                                                   size_t, fmi3Float64 sensitivity[], size_t);
FMI_EXPORT fmi3Status fmi3GetAdjointDerivative(fmi3Instance, const fmi3ValueReference unknowns[], size_t,
                                               const fmi3ValueReference knowns[], size_t, const fmi3Float64 seed[],
                                               size_t, fmi3Float64 sensitivity[], size_t);
FMI_EXPORT fmi3Status fmi3EnterConfigurationMode(fmi3Instance);
FMI_EXPORT fmi3Status fmi3ExitConfigurationMode(fmi3Instance);

FMI_EXPORT fmi3Status fmi3GetIntervalDecimal(fmi3Instance, const fmi3ValueReference[], size_t, fmi3Float64 intervals[],
                                             fmi3IntervalQualifier[]);
FMI_EXPORT fmi3Status fmi3GetIntervalFraction(fmi3Instance, const fmi3ValueReference[], size_t, fmi3UInt64 counters[],
                                              fmi3UInt64 resolutions[], fmi3IntervalQualifier[]);
FMI_EXPORT fmi3Status fmi3GetShiftDecimal(fmi3Instance, const fmi3ValueReference[], size_t, fmi3Float64 shifts[]);
FMI_EXPORT fmi3Status fmi3GetShiftFraction(fmi3Instance, const fmi3ValueReference[], size_t, fmi3UInt64 counters[],
                                           fmi3UInt64 resolutions[]);
FMI_EXPORT fmi3Status fmi3SetIntervalDecimal(fmi3Instance, const fmi3ValueReference[], size_t,
                                             const fmi3Float64 intervals[]);
FMI_EXPORT fmi3Status fmi3SetIntervalFraction(fmi3Instance, const fmi3ValueReference[], size_t,
                                              const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]);
FMI_EXPORT fmi3Status fmi3SetShiftDecimal(fmi3Instance, const fmi3ValueReference[], size_t, const fmi3Float64 shifts[]);
FMI_EXPORT fmi3Status fmi3SetShiftFraction(fmi3Instance, const fmi3ValueReference[], size_t,
                                           const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]);
FMI_EXPORT fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance);
FMI_EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance, fmi3Boolean *discreteStatesNeedUpdate,
                                               fmi3Boolean *terminateSimulation,
                                               fmi3Boolean *nominalsOfContinuousStatesChanged,
                                               fmi3Boolean *valuesOfContinuousStatesChanged,
                                               fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime);

/* FMI 3.0: model exchange */

FMI_EXPORT fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance);
FMI_EXPORT fmi3Status fmi3CompletedIntegratorStep(fmi3Instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                                  fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation);
FMI_EXPORT fmi3Status fmi3SetTime(fmi3Instance, fmi3Float64);
FMI_EXPORT fmi3Status fmi3SetContinuousStates(fmi3Instance, const fmi3Float64[], size_t);
FMI_EXPORT fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance, fmi3Float64[], size_t);
FMI_EXPORT fmi3Status fmi3GetEventIndicators(fmi3Instance, fmi3Float64[], size_t);
FMI_EXPORT fmi3Status fmi3GetContinuousStates(fmi3Instance, fmi3Float64[], size_t);
FMI_EXPORT fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance, fmi3Float64[], size_t);
FMI_EXPORT fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance, size_t *);
FMI_EXPORT fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance, size_t *);

/* FMI 3.0: co-simulation and scheduled execution */

FMI_EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance);
FMI_EXPORT fmi3Status fmi3GetOutputDerivatives(fmi3Instance, const fmi3ValueReference[], size_t,
                                               const fmi3Int32 orders[], fmi3Float64[], size_t);
FMI_EXPORT fmi3Status fmi3DoStep(fmi3Instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                                 fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded,
                                 fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn,
                                 fmi3Float64 *lastSuccessfulTime);
FMI_EXPORT fmi3Status fmi3ActivateModelPartition(fmi3Instance, fmi3ValueReference clockReference,
                                                 fmi3Float64 activationTime);

#endif
