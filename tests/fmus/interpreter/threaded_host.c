/* A host that is not Python: instantiates units of FMI 2 from as many threads at once and makes ten steps with each. */
#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>

#include "fmi.h"

#define MOST 8

static pthread_mutex_t gate = PTHREAD_MUTEX_INITIALIZER; /* shut until all threads are there */

static void log_message(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String message, ...) {
    (void)e, (void)status, (void)category;
    printf("[%s] %s\n", name, message);
}

#define LOAD(name) __typeof__(name) *f_##name = (__typeof__(name) *)dlsym(library, #name)

static void *run(void *arguments) { /* library, GUID, resource URI */
    char **unit_of = arguments;
    void *library = dlopen(unit_of[0], RTLD_NOW | RTLD_LOCAL);
    LOAD(fmi2Instantiate);
    LOAD(fmi2SetupExperiment);
    LOAD(fmi2EnterInitializationMode);
    LOAD(fmi2ExitInitializationMode);
    LOAD(fmi2DoStep);
    LOAD(fmi2FreeInstance);
    fmi2CallbackFunctions callbacks = {.logger = log_message};
    pthread_mutex_lock(&gate);
    pthread_mutex_unlock(&gate);
    fmi2Component unit = f_fmi2Instantiate("unit", fmi2CoSimulation, unit_of[1], unit_of[2], &callbacks, 0, 0);
    if (!unit) return "no instance";
    int status = f_fmi2SetupExperiment(unit, 0, 0.0, 0.0, 0, 0.0) || f_fmi2EnterInitializationMode(unit) ||
                 f_fmi2ExitInitializationMode(unit);
    for (int i = 0; i < 10 && !status; i++) status = f_fmi2DoStep(unit, i * 0.25, 0.25, 1);
    f_fmi2FreeInstance(unit);
    return status ? "a call failed" : NULL;
}

int main(int argc, char **argv) { /* three arguments for each unit */
    int n = (argc - 1) / 3, failed = 0;
    pthread_t threads[MOST];
    if (n < 1 || n > MOST) return 2;
    pthread_mutex_lock(&gate);
    for (int i = 0; i < n; i++) pthread_create(&threads[i], NULL, run, argv + 1 + 3 * i);
    pthread_mutex_unlock(&gate);
    for (int i = 0; i < n; i++) {
        void *fault;
        pthread_join(threads[i], &fault);
        if (fault) printf("%s\n", (char *)fault), failed = 1;
    }
    if (!failed) printf("all done\n");
    return failed;
}
