/* A host that needs the C library alone: steps a unit of FMI 2 or FMI 3 and prints its outputs' bytes, a line a step.
 *
 * Arguments: 2 or 3, the standard; library, folder of the resources (in FMI 2 its URI), token, step in s, number of steps,
 * number of instances that are stepped by turns; then for each output its kind (f real, i integer, b boolean, p binary),
 * value reference and number of values, as in f:12:3.
 */
#include <dlfcn.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi.h"

#define LOADED(name) ((__typeof__(name) *)dlsym(library, #name))
#define MOST_VALUES 4096
#define MOST_INSTANCES 8

/* The calls of a standard that this host needs. */
typedef struct {
    void *(*start)(const char *token, const char *resources);
    bool (*step)(void *unit, double t, double dt);
    bool (*print)(void *unit, char kind, unsigned reference, size_t count);
    void (*end)(void *unit);
} Standard;

static void *library;

static void print(const void *values, size_t size) {
    for (size_t i = 0; i < size; i++) printf("%02x", ((const uint8_t *)values)[i]);
    printf(" ");
}

static void log2(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                 fmi2String message, ...) {
    (void)environment, (void)name, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

static void *start2(const char *token, const char *resources) {
    static const fmi2CallbackFunctions host = {.logger = log2, .allocateMemory = calloc, .freeMemory = free};
    fmi2Component unit = LOADED(fmi2Instantiate)("unit", fmi2CoSimulation, token, resources, &host, 0, 1);
    bool ready = unit && LOADED(fmi2SetupExperiment)(unit, 0, 0.0, 0.0, 0, 0.0) <= fmi2Warning &&
                 LOADED(fmi2EnterInitializationMode)(unit) <= fmi2Warning &&
                 LOADED(fmi2ExitInitializationMode)(unit) <= fmi2Warning;
    return ready ? unit : NULL;
}

static bool step2(void *unit, double t, double dt) { return LOADED(fmi2DoStep)(unit, t, dt, 1) <= fmi2Warning; }

static bool print2(void *unit, char kind, unsigned reference, size_t count) {
    double real;
    int integer;
    bool is_real = kind == 'f';
    fmi2Status status = is_real       ? LOADED(fmi2GetReal)(unit, &reference, count, &real)
                        : kind == 'i' ? LOADED(fmi2GetInteger)(unit, &reference, count, &integer)
                                      : LOADED(fmi2GetBoolean)(unit, &reference, count, &integer);
    if (status == fmi2OK) print(is_real ? (void *)&real : &integer, is_real ? sizeof real : sizeof integer);
    return status == fmi2OK;
}

static void end2(void *unit) { LOADED(fmi2FreeInstance)(unit); }

static void log3(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    (void)environment, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

static void *start3(const char *token, const char *resources) {
    fmi3Instance unit = LOADED(fmi3InstantiateCoSimulation)("unit", token, resources, false, true, false, false, NULL, 0,
                                                            NULL, log3, NULL);
    bool ready = unit && LOADED(fmi3EnterInitializationMode)(unit, false, 0.0, 0.0, false, 0.0) <= fmi3Warning &&
                 LOADED(fmi3ExitInitializationMode)(unit) <= fmi3Warning;
    return ready ? unit : NULL;
}

static bool step3(void *unit, double t, double dt) {
    static fmi3Status (*step)(fmi3Instance, double, double, bool, bool *, bool *, bool *, double *);
    bool event, terminates, early;
    double last;
    if (!step) step = LOADED(fmi3DoStep);
    return step(unit, t, dt, true, &event, &terminates, &early, &last) <= fmi3Warning;
}

static bool print3(void *unit, char kind, unsigned reference, size_t count) {
    static double floats[MOST_VALUES];
    int64_t integer;
    bool truth;
    fmi3Binary bytes;
    if (count > MOST_VALUES) return false;
    if (kind == 'f' && LOADED(fmi3GetFloat64)(unit, &reference, 1, floats, count) == fmi3OK)
        print(floats, count * sizeof *floats);
    else if (kind == 'i' && LOADED(fmi3GetInt64)(unit, &reference, 1, &integer, 1) == fmi3OK)
        print(&integer, sizeof integer);
    else if (kind == 'b' && LOADED(fmi3GetBoolean)(unit, &reference, 1, &truth, 1) == fmi3OK)
        print(&truth, sizeof truth);
    else if (kind == 'p' && LOADED(fmi3GetBinary)(unit, &reference, 1, &count, &bytes, 1) == fmi3OK)
        print(bytes, count);
    else
        return false;
    return true;
}

static void end3(void *unit) { LOADED(fmi3FreeInstance)(unit); }

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int main(int argc, char **argv) {
    if (argc < 8) return 2;
    const Standard fmi2 = {start2, step2, print2, end2}, fmi3 = {start3, step3, print3, end3};
    const Standard *standard = strcmp(argv[1], "2") == 0 ? &fmi2 : &fmi3;
    library = dlopen(argv[2], RTLD_NOW | RTLD_LOCAL);
    if (!library) return fprintf(stderr, "%s\n", dlerror()), 2;
    double dt = strtod(argv[5], NULL), begun = seconds();
    int steps = atoi(argv[6]), instances = atoi(argv[7]);
    void *units[MOST_INSTANCES];
    for (int k = 0; k < instances; k++) {
        units[k] = standard->start(argv[4], argv[3]);
        if (!units[k]) return fprintf(stderr, "instance %d does not start\n", k), 1;
    }
    fprintf(stderr, "started in %.3f s\n", seconds() - begun);
    double stepping = 0.0, fastest = 1e9;
    for (int n = 0; n < steps; n++) {
        for (int k = 0; k < instances; k++) {
            double from = seconds();
            if (!standard->step(units[k], n * dt, dt)) return 1;
            double took = seconds() - from;
            stepping += took;
            if (took < fastest) fastest = took;
            if (n == 0 && k == 0) fprintf(stderr, "first step after %.3f s\n", seconds() - begun);
            for (int i = 8; i < argc; i++) {
                char kind;
                unsigned reference;
                size_t count;
                if (sscanf(argv[i], "%c:%u:%zu", &kind, &reference, &count) != 3) return 2;
                if (!standard->print(units[k], kind, reference, count))
                    return fprintf(stderr, "%s cannot be read\n", argv[i]), 1;
            }
            printf("\n");
        }
    }
    fprintf(stderr, "%.1f us a step, %.1f us the fastest\n", 1e6 * stepping / (steps * instances), 1e6 * fastest);
    for (int k = 0; k < instances; k++) standard->end(units[k]);
    return 0;
}
