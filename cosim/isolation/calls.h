/* The functions of both standards, as the unit's process looks them up in its library, and how each is called there.
 *
 * The names are those that FMPy requires of a library, so that a unit that lacks one is refused here too. */
#ifndef CALLS_H
#define CALLS_H

/* INTEGERS: all arguments are integers or addresses, the status is returned. ABSENT: looked up, never called. */
enum shape {
    ABSENT,
    INTEGERS,
    FREE,
    INSTANTIATE_2,
    INSTANTIATE_3,
    SETUP_2,
    SETUP_3,
    STEP_2,
    STEP_3,
    GET_TEXTS,
    GET_BINARIES,
    LOAD,   /* the library */
    UNLOAD, /* and end the process */
    MAP,    /* another instance's memory */
    GET_SLOT
};

#define CALLS(X)                                                                                                       \
    X(load_library, LOAD)                                                                                              \
    X(unload_library, UNLOAD)                                                                                          \
    X(map_memory, MAP)                                                                                                 \
    X(get_slot, GET_SLOT)                                                                                              \
    CALLS_2(X)                                                                                                         \
    CALLS_3(X)

#define CALLS_2(X)                                                                                                     \
    X(fmi2Instantiate, INSTANTIATE_2)                                                                                  \
    X(fmi2FreeInstance, FREE)                                                                                          \
    X(fmi2SetDebugLogging, INTEGERS)                                                                                   \
    X(fmi2SetupExperiment, SETUP_2)                                                                                    \
    X(fmi2EnterInitializationMode, INTEGERS)                                                                           \
    X(fmi2ExitInitializationMode, INTEGERS)                                                                            \
    X(fmi2Terminate, INTEGERS)                                                                                         \
    X(fmi2Reset, INTEGERS)                                                                                             \
    X(fmi2GetReal, INTEGERS)                                                                                           \
    X(fmi2GetInteger, INTEGERS)                                                                                        \
    X(fmi2GetBoolean, INTEGERS)                                                                                        \
    X(fmi2GetString, GET_TEXTS)                                                                                        \
    X(fmi2SetReal, INTEGERS)                                                                                           \
    X(fmi2SetInteger, INTEGERS)                                                                                        \
    X(fmi2SetBoolean, INTEGERS)                                                                                        \
    X(fmi2SetString, INTEGERS)                                                                                         \
    X(fmi2GetFMUstate, INTEGERS)                                                                                       \
    X(fmi2SetFMUstate, INTEGERS)                                                                                       \
    X(fmi2FreeFMUstate, INTEGERS)                                                                                      \
    X(fmi2SerializedFMUstateSize, INTEGERS)                                                                            \
    X(fmi2SerializeFMUstate, INTEGERS)                                                                                 \
    X(fmi2DeSerializeFMUstate, INTEGERS)                                                                               \
    X(fmi2GetDirectionalDerivative, INTEGERS)                                                                          \
    X(fmi2SetRealInputDerivatives, INTEGERS)                                                                           \
    X(fmi2GetRealOutputDerivatives, INTEGERS)                                                                          \
    X(fmi2DoStep, STEP_2)                                                                                              \
    X(fmi2CancelStep, INTEGERS)                                                                                        \
    X(fmi2GetStatus, INTEGERS)                                                                                         \
    X(fmi2GetRealStatus, INTEGERS)                                                                                     \
    X(fmi2GetIntegerStatus, INTEGERS)                                                                                  \
    X(fmi2GetBooleanStatus, INTEGERS)                                                                                  \
    X(fmi2GetStringStatus, ABSENT)                                                                                     \
    X(fmi2GetTypesPlatform, ABSENT)                                                                                    \
    X(fmi2GetVersion, ABSENT)

#define CALLS_3(X)                                                                                                     \
    X(fmi3InstantiateCoSimulation, INSTANTIATE_3)                                                                      \
    X(fmi3FreeInstance, FREE)                                                                                          \
    X(fmi3SetDebugLogging, INTEGERS)                                                                                   \
    X(fmi3EnterInitializationMode, SETUP_3)                                                                            \
    X(fmi3ExitInitializationMode, INTEGERS)                                                                            \
    X(fmi3EnterEventMode, INTEGERS)                                                                                    \
    X(fmi3EnterStepMode, INTEGERS)                                                                                     \
    X(fmi3EnterConfigurationMode, INTEGERS)                                                                            \
    X(fmi3ExitConfigurationMode, INTEGERS)                                                                             \
    X(fmi3Terminate, INTEGERS)                                                                                         \
    X(fmi3Reset, INTEGERS)                                                                                             \
    X(fmi3GetFloat32, INTEGERS)                                                                                        \
    X(fmi3GetFloat64, INTEGERS)                                                                                        \
    X(fmi3GetInt8, INTEGERS)                                                                                           \
    X(fmi3GetUInt8, INTEGERS)                                                                                          \
    X(fmi3GetInt16, INTEGERS)                                                                                          \
    X(fmi3GetUInt16, INTEGERS)                                                                                         \
    X(fmi3GetInt32, INTEGERS)                                                                                          \
    X(fmi3GetUInt32, INTEGERS)                                                                                         \
    X(fmi3GetInt64, INTEGERS)                                                                                          \
    X(fmi3GetUInt64, INTEGERS)                                                                                         \
    X(fmi3GetBoolean, INTEGERS)                                                                                        \
    X(fmi3GetString, GET_TEXTS)                                                                                        \
    X(fmi3GetBinary, GET_BINARIES)                                                                                     \
    X(fmi3GetClock, INTEGERS)                                                                                          \
    X(fmi3SetFloat32, INTEGERS)                                                                                        \
    X(fmi3SetFloat64, INTEGERS)                                                                                        \
    X(fmi3SetInt8, INTEGERS)                                                                                           \
    X(fmi3SetUInt8, INTEGERS)                                                                                          \
    X(fmi3SetInt16, INTEGERS)                                                                                          \
    X(fmi3SetUInt16, INTEGERS)                                                                                         \
    X(fmi3SetInt32, INTEGERS)                                                                                          \
    X(fmi3SetUInt32, INTEGERS)                                                                                         \
    X(fmi3SetInt64, INTEGERS)                                                                                          \
    X(fmi3SetUInt64, INTEGERS)                                                                                         \
    X(fmi3SetBoolean, INTEGERS)                                                                                        \
    X(fmi3SetString, INTEGERS)                                                                                         \
    X(fmi3SetBinary, INTEGERS)                                                                                         \
    X(fmi3SetClock, INTEGERS)                                                                                          \
    X(fmi3GetFMUState, INTEGERS)                                                                                       \
    X(fmi3SetFMUState, INTEGERS)                                                                                       \
    X(fmi3FreeFMUState, INTEGERS)                                                                                      \
    X(fmi3SerializedFMUStateSize, INTEGERS)                                                                            \
    X(fmi3SerializeFMUState, INTEGERS)                                                                                 \
    X(fmi3DeserializeFMUState, INTEGERS)                                                                               \
    X(fmi3GetDirectionalDerivative, INTEGERS)                                                                          \
    X(fmi3GetAdjointDerivative, INTEGERS)                                                                              \
    X(fmi3GetOutputDerivatives, INTEGERS)                                                                              \
    X(fmi3GetIntervalDecimal, INTEGERS)                                                                                \
    X(fmi3GetIntervalFraction, INTEGERS)                                                                               \
    X(fmi3GetShiftDecimal, INTEGERS)                                                                                   \
    X(fmi3GetShiftFraction, INTEGERS)                                                                                  \
    X(fmi3SetIntervalDecimal, INTEGERS)                                                                                \
    X(fmi3SetIntervalFraction, INTEGERS)                                                                               \
    X(fmi3SetShiftDecimal, INTEGERS)                                                                                   \
    X(fmi3SetShiftFraction, INTEGERS)                                                                                  \
    X(fmi3EvaluateDiscreteStates, INTEGERS)                                                                            \
    X(fmi3UpdateDiscreteStates, INTEGERS)                                                                              \
    X(fmi3DoStep, STEP_3)                                                                                              \
    NOT_CALLED_3(X)

#define NOT_CALLED_3(X)                                                                                                \
    X(fmi3GetVersion, ABSENT)                                                                                          \
    X(fmi3InstantiateModelExchange, ABSENT)                                                                            \
    X(fmi3InstantiateScheduledExecution, ABSENT)                                                                       \
    X(fmi3GetNumberOfVariableDependencies, ABSENT)                                                                     \
    X(fmi3GetVariableDependencies, ABSENT)                                                                             \
    X(fmi3EnterContinuousTimeMode, ABSENT)                                                                             \
    X(fmi3CompletedIntegratorStep, ABSENT)                                                                             \
    X(fmi3SetTime, ABSENT)                                                                                             \
    X(fmi3SetContinuousStates, ABSENT)                                                                                 \
    X(fmi3GetContinuousStateDerivatives, ABSENT)                                                                       \
    X(fmi3GetEventIndicators, ABSENT)                                                                                  \
    X(fmi3GetContinuousStates, ABSENT)                                                                                 \
    X(fmi3GetNominalsOfContinuousStates, ABSENT)                                                                       \
    X(fmi3GetNumberOfEventIndicators, ABSENT)                                                                          \
    X(fmi3GetNumberOfContinuousStates, ABSENT)                                                                         \
    X(fmi3ActivateModelPartition, ABSENT)

#define AS_ENUM(name, shape) CALL_##name,
enum call { CALLS(AS_ENUM) N_CALLS };
#undef AS_ENUM

#endif
