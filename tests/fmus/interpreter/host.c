/* A host that is not Python: loads an FMI 2 unit's library, makes 100 steps and prints the output "b". */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi.h"

static void log_message(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String message, ...) {
    (void)e, (void)category;
    va_list arguments;
    va_start(arguments, message);
    printf("[%s %d] ", name, status);
    vprintf(message, arguments);
    printf("\n");
    va_end(arguments);
}

#define LOAD(name) __typeof__(name) *f_##name = (__typeof__(name) *)dlsym(library, #name)

int main(int argc, char **argv) { /* library, GUID, resource URI, value references of a and b */
    unsigned a, b;
    if (argc != 6 || sscanf(argv[4], "%u", &a) != 1 || sscanf(argv[5], "%u", &b) != 1) return 2;
    const char *before = getenv("HOST_LOADS_BEFORE");
    if (before && !dlopen(before, RTLD_NOW | RTLD_GLOBAL)) return printf("%s\n", dlerror()), 2;
    void *library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) return printf("%s\n", dlerror()), 2;
    LOAD(fmi2Instantiate);
    LOAD(fmi2SetupExperiment);
    LOAD(fmi2EnterInitializationMode);
    LOAD(fmi2ExitInitializationMode);
    LOAD(fmi2SetReal);
    LOAD(fmi2GetReal);
    LOAD(fmi2DoStep);
    LOAD(fmi2Terminate);
    LOAD(fmi2FreeInstance);
    for (int round = 0; round < 2; round++) {
        fmi2CallbackFunctions callbacks = {.logger = log_message};
        fmi2Component unit = f_fmi2Instantiate("unit", fmi2CoSimulation, argv[2], argv[3], &callbacks, 0,
                                                !!getenv("HOST_LOGS"));
        if (!unit) return 1;
        int status = f_fmi2SetupExperiment(unit, 0, 0.0, 0.0, 0, 0.0) || f_fmi2EnterInitializationMode(unit) ||
                     f_fmi2ExitInitializationMode(unit);
        double value = 0.0;
        for (int i = 0; i < 100 && !status; i++) {
            value = i;
            status = f_fmi2SetReal(unit, &a, 1, &value) || f_fmi2DoStep(unit, i * 0.25, 0.25, 1);
        }
        if (status || f_fmi2GetReal(unit, &b, 1, &value) || f_fmi2Terminate(unit)) return 1;
        printf("b = %.17g\n", value);
        f_fmi2FreeInstance(unit);
    }
    return 0;
}
