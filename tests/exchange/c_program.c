/* A host that is not Python and knows no unit: it makes the calls that a file lists, and prints what it gets.
 *
 * Arguments: version of FMI (2 or 3), library, GUID or instantiation token, resources (FMI 2: URI, FMI 3: path), file.
 * Calls, a line each, with value references, numbers of values and files of bytes:
 *     set real|integer|boolean REFERENCE N VALUE...     set binary REFERENCE FILE
 *     get real|integer|boolean REFERENCE N              get binary REFERENCE FILE
 *     initialise                                        step TIME SIZE
 * `get` prints its values on one line, with all digits; of bytes it prints how many it has written to the file.
 */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi.h"

#define MOST 1024
#define LOAD(name) __typeof__(name) *f_##name = (__typeof__(name) *)find(#name)

static void *library, *unit;
static int is_fmi2;

static void *find(const char *name) {
    void *found = dlsym(library, name);
    if (!found) printf("no function %s\n", name), exit(2);
    return found;
}

static void expect_ok(int status, const char *what) {
    if (status) printf("%s: status %d\n", what, status), exit(1);
}

static void log2_message(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category,
                         fmi2String message, ...) {
    (void)e, (void)category;
    va_list arguments;
    va_start(arguments, message);
    printf("[%s %d] ", name, status);
    vprintf(message, arguments);
    printf("\n");
    va_end(arguments);
}

static void log3_message(fmi3InstanceEnvironment e, fmi3Status status, fmi3String category, fmi3String message) {
    (void)e;
    printf("[%s %d] %s\n", category, status, message);
}

static void instantiate(const char *token, const char *resources) {
    static const fmi2CallbackFunctions callbacks = {.logger = log2_message};
    if (is_fmi2) {
        LOAD(fmi2Instantiate);
        unit = f_fmi2Instantiate("unit", fmi2CoSimulation, token, resources, &callbacks, 0, 0);
    } else {
        LOAD(fmi3InstantiateCoSimulation);
        unit = f_fmi3InstantiateCoSimulation("unit", token, resources, 0, 0, 0, 0, NULL, 0, NULL, log3_message, NULL);
    }
    if (!unit) exit(1);
}

static void initialise(void) {
    if (is_fmi2) {
        LOAD(fmi2SetupExperiment);
        LOAD(fmi2EnterInitializationMode);
        LOAD(fmi2ExitInitializationMode);
        expect_ok(f_fmi2SetupExperiment(unit, 0, 0.0, 0.0, 0, 0.0), "set up");
        expect_ok(f_fmi2EnterInitializationMode(unit), "enter");
        expect_ok(f_fmi2ExitInitializationMode(unit), "exit");
    } else {
        LOAD(fmi3EnterInitializationMode);
        LOAD(fmi3ExitInitializationMode);
        expect_ok(f_fmi3EnterInitializationMode(unit, 0, 0.0, 0.0, 0, 0.0), "enter");
        expect_ok(f_fmi3ExitInitializationMode(unit), "exit");
    }
}

static void step(double t, double size) {
    if (is_fmi2) {
        LOAD(fmi2DoStep);
        expect_ok(f_fmi2DoStep(unit, t, size, 1), "step");
    } else {
        LOAD(fmi3DoStep);
        bool event, end, early;
        double last;
        expect_ok(f_fmi3DoStep(unit, t, size, 1, &event, &end, &early, &last), "step");
        if (event || end || early) printf("the step ended otherwise\n"), exit(1);
    }
}

/* Hand over N values under one value reference (FMI 2: one value) and take them back. Here all are doubles, which hold
 * every number that the units have. */
#define TRANSFER(is_set, reference, n, values, type2, Type2, type3, Type3)                                             \
    if (is_fmi2) {                                                                                                     \
        LOAD(fmi2Set##Type2);                                                                                          \
        LOAD(fmi2Get##Type2);                                                                                          \
        type2 own[MOST];                                                                                               \
        for (size_t i = 0; i < n; i++) own[i] = (type2)values[i];                                                      \
        expect_ok((is_set) ? f_fmi2Set##Type2(unit, &reference, n, own) : f_fmi2Get##Type2(unit, &reference, n, own),  \
                  "transfer of " #Type2);                                                                              \
        for (size_t i = 0; i < n; i++) values[i] = (double)own[i];                                                     \
    } else {                                                                                                           \
        LOAD(fmi3Set##Type3);                                                                                          \
        LOAD(fmi3Get##Type3);                                                                                          \
        type3 own[MOST];                                                                                               \
        for (size_t i = 0; i < n; i++) own[i] = (type3)values[i];                                                      \
        expect_ok((is_set) ? f_fmi3Set##Type3(unit, &reference, 1, own, n)                                             \
                           : f_fmi3Get##Type3(unit, &reference, 1, own, n),                                            \
                  "transfer of " #Type3);                                                                              \
        for (size_t i = 0; i < n; i++) values[i] = (double)own[i];                                                     \
    }

static void transfer_bytes(int is_set, unsigned reference, const char *path) {
    FILE *file = fopen(path, is_set ? "rb" : "wb");
    if (!file) printf("no file %s\n", path), exit(2);
    size_t size = 0;
    if (is_set) {
        LOAD(fmi3SetBinary);
        fseek(file, 0, SEEK_END);
        size = (size_t)ftell(file);
        rewind(file);
        uint8_t *bytes = malloc(size);
        const uint8_t *given = bytes;
        if (fread(bytes, 1, size, file) != size) exit(2);
        expect_ok(f_fmi3SetBinary(unit, &reference, 1, &size, &given, 1), "set binary");
        free(bytes);
    } else {
        LOAD(fmi3GetBinary);
        const uint8_t *bytes;
        expect_ok(f_fmi3GetBinary(unit, &reference, 1, &size, &bytes, 1), "get binary");
        if (fwrite(bytes, 1, size, file) != size) exit(2);
        printf("%zu\n", size);
    }
    fclose(file);
}

static void transfer(int is_set, const char *type, unsigned reference, FILE *calls) {
    size_t n;
    double values[MOST] = {0};
    if (fscanf(calls, "%zu", &n) != 1 || n > MOST) exit(2);
    for (size_t i = 0; is_set && i < n; i++)
        if (fscanf(calls, "%lf", &values[i]) != 1) exit(2);
    if (!strcmp(type, "real")) {
        TRANSFER(is_set, reference, n, values, double, Real, double, Float64)
    } else if (!strcmp(type, "integer")) {
        TRANSFER(is_set, reference, n, values, int, Integer, int64_t, Int64)
    } else if (!strcmp(type, "boolean")) {
        TRANSFER(is_set, reference, n, values, int, Boolean, bool, Boolean)
    } else {
        exit(2);
    }
    for (size_t i = 0; !is_set && i < n; i++) printf(i + 1 < n ? "%.17g " : "%.17g\n", values[i]);
}

int main(int argc, char **argv) {
    if (argc != 6) return 2;
    is_fmi2 = !strcmp(argv[1], "2");
    library = dlopen(argv[2], RTLD_NOW | RTLD_LOCAL);
    if (!library) return printf("%s\n", dlerror()), 2;
    instantiate(argv[3], argv[4]);
    FILE *calls = fopen(argv[5], "r");
    if (!calls) return 2;
    char call[16], type[16], path[4096];
    unsigned reference;
    double t, size;
    while (fscanf(calls, "%15s", call) == 1) {
        if (!strcmp(call, "initialise")) {
            initialise();
        } else if (!strcmp(call, "step")) {
            if (fscanf(calls, "%lf %lf", &t, &size) != 2) return 2;
            step(t, size);
        } else {
            if (fscanf(calls, "%15s %u", type, &reference) != 2) return 2;
            if (strcmp(type, "binary")) {
                transfer(!strcmp(call, "set"), type, reference, calls);
            } else {
                if (fscanf(calls, " %4095[^\n]", path) != 1) return 2;
                transfer_bytes(!strcmp(call, "set"), reference, path);
            }
        }
    }
    fclose(calls);
    if (is_fmi2) {
        LOAD(fmi2Terminate);
        LOAD(fmi2FreeInstance);
        expect_ok(f_fmi2Terminate(unit), "terminate");
        f_fmi2FreeInstance(unit);
    } else {
        LOAD(fmi3Terminate);
        LOAD(fmi3FreeInstance);
        expect_ok(f_fmi3Terminate(unit), "terminate");
        f_fmi3FreeInstance(unit);
    }
    return 0;
}
