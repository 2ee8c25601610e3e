/* A host that ends the Python of its process, which a unit had started, while the unit's instance lives. */
#include <dlfcn.h>
#include <stdio.h>

#include "fmi.h"

static void log_message(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String message, ...) {
    (void)e, (void)name, (void)status, (void)category;
    printf("%s\n", message);
}

#define LOAD(name) __typeof__(name) *f_##name = (__typeof__(name) *)dlsym(library, #name)

static int end_python(void) {
    int (*ensure)(void) = (int (*)(void))dlsym(RTLD_DEFAULT, "PyGILState_Ensure");
    int (*finalise)(void) = (int (*)(void))dlsym(RTLD_DEFAULT, "Py_FinalizeEx");
    if (!ensure || !finalise) return 0;
    ensure();
    return finalise() == 0;
}

int main(int argc, char **argv) { /* library, GUID, resource URI, and two that are not used */
    if (argc != 6) return 2;
    void *library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) return printf("%s\n", dlerror()), 2;
    LOAD(fmi2Instantiate);
    LOAD(fmi2SetupExperiment);
    LOAD(fmi2EnterInitializationMode);
    LOAD(fmi2ExitInitializationMode);
    LOAD(fmi2DoStep);
    LOAD(fmi2GetFMUstate);
    LOAD(fmi2SetString);
    LOAD(fmi2Reset);
    LOAD(fmi2FreeInstance);
    fmi2CallbackFunctions callbacks = {.logger = log_message};
    fmi2Component unit = f_fmi2Instantiate("unit", fmi2CoSimulation, argv[2], argv[3], &callbacks, 0, 0);
    if (!unit || f_fmi2SetupExperiment(unit, 0, 0.0, 0.0, 0, 0.0) || f_fmi2EnterInitializationMode(unit) ||
        f_fmi2ExitInitializationMode(unit))
        return 2;
    printf("step = %d\n", f_fmi2DoStep(unit, 0.0, 0.25, 1));
    if (!end_python()) return 2;
    printf("step = %d\n", f_fmi2DoStep(unit, 0.25, 0.25, 1));
    fmi2FMUstate state = NULL;
    printf("state = %d\n", f_fmi2GetFMUstate(unit, &state));
    unsigned none = 0;
    fmi2String value = "";
    printf("string = %d\n", f_fmi2SetString(unit, &none, 1, &value));
    printf("reset = %d\n", f_fmi2Reset(unit));
    f_fmi2FreeInstance(unit);
    printf("freed = 1\n");
    return 0;
}
