/* A host of another platform that has no Python: instantiates a unit, then calls each function without an instance.
 * Compiled once per standard with FMI=2 or 3; calls.h is written by the test, a line `CALL(fmi2Reset, NULL)` for each. */
#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi.h"

#ifdef _WIN32
static void *open_library(const char *path) { return (void *)LoadLibraryA(path); }
static void *function(void *library, const char *name) { return (void *)GetProcAddress((HMODULE)library, name); }
static int close_library(void *library) { return FreeLibrary((HMODULE)library) ? 0 : -1; }
#else
static void *open_library(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static void *function(void *library, const char *name) { return dlsym(library, name); }
static int close_library(void *library) { return dlclose(library); }
#endif

#define FUNCTION(name) ((__typeof__(name) *)needed(library, #name))

static void *needed(void *library, const char *name) {
    void *found = function(library, name);
    if (!found) printf("%s is missing\n", name), exit(2);
    return found;
}

#if FMI == 2
static void log_message(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String message, ...) {
    (void)e;
    va_list arguments;
    va_start(arguments, message);
    printf("[%s %d %s] ", name, status, category);
    vprintf(message, arguments);
    printf("\n");
    va_end(arguments);
}

static void *instantiate(void *library, const char *token, const char *resources) {
    fmi2CallbackFunctions callbacks = {.logger = log_message};
    return FUNCTION(fmi2Instantiate)("unit", fmi2CoSimulation, token, resources, &callbacks, 0, 0);
}
#else
static void log_message(fmi3InstanceEnvironment e, fmi3Status status, fmi3String category, fmi3String message) {
    (void)e;
    printf("[unit %d %s] %s\n", status, category, message);
}

static void *instantiate(void *library, const char *token, const char *resources) {
    return FUNCTION(fmi3InstantiateCoSimulation)("unit", token, resources, 0, 0, 0, 0, NULL, 0, NULL, log_message, NULL);
}
#endif

#define CALL(name, ...) printf(#name " = %d\n", (int)FUNCTION(name)(__VA_ARGS__));
#define CALL_VOID(name, ...) FUNCTION(name)(__VA_ARGS__), printf(#name " returned\n");

int main(int argc, char **argv) { /* library, token, resources */
    if (argc != 4) return 2;
    void *library = open_library(argv[1]);
    if (!library) return printf("%s cannot be loaded\n", argv[1]), 2;
    for (int round = 0; round < 2; round++) {
        void *unit = instantiate(library, argv[2], argv[3]);
        printf("instance: %s\n", unit ? "made" : "none");
    }
#include "calls.h"
    printf("closed: %d\n", close_library(library));
    return 0;
}
