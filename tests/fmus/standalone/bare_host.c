/* A host that needs the C library alone: steps an FMI 3 unit and prints its outputs' bytes, a line a step.
 *
 * Arguments: library, folder of the resources, instantiation token, step in s, number of steps, number of instances that
 * are stepped by turns; then for each output its kind (f float64, i int64, b boolean, p binary), value reference and
 * number of values, as in f:12:3.
 */
#include <dlfcn.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi.h"

#define LOAD(name) __typeof__(name) *f_##name = (__typeof__(name) *)dlsym(library, #name)
#define MOST_VALUES 4096
#define MOST_INSTANCES 8

static void log_message(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    (void)environment, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

static void print(const void *values, size_t size) {
    for (size_t i = 0; i < size; i++) printf("%02x", ((const uint8_t *)values)[i]);
    printf(" ");
}

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int main(int argc, char **argv) {
    if (argc < 7) return 2;
    void *library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) return fprintf(stderr, "%s\n", dlerror()), 2;
    LOAD(fmi3InstantiateCoSimulation);
    LOAD(fmi3EnterInitializationMode);
    LOAD(fmi3ExitInitializationMode);
    LOAD(fmi3DoStep);
    LOAD(fmi3GetFloat64);
    LOAD(fmi3GetInt64);
    LOAD(fmi3GetBoolean);
    LOAD(fmi3GetBinary);
    LOAD(fmi3FreeInstance);
    double dt = strtod(argv[4], NULL), begun = seconds();
    int steps = atoi(argv[5]), instances = atoi(argv[6]);
    fmi3Instance units[MOST_INSTANCES];
    for (int k = 0; k < instances; k++) {
        units[k] = f_fmi3InstantiateCoSimulation("unit", argv[3], argv[2], false, true, false, false, NULL, 0, NULL,
                                                 log_message, NULL);
        if (!units[k] || f_fmi3EnterInitializationMode(units[k], false, 0.0, 0.0, false, 0.0) > fmi3Warning ||
            f_fmi3ExitInitializationMode(units[k]) > fmi3Warning)
            return fprintf(stderr, "instance %d does not start\n", k), 1;
    }
    fprintf(stderr, "started in %.3f s\n", seconds() - begun);
    double stepping = 0.0;
    for (int n = 0; n < steps; n++) {
        for (int k = 0; k < instances; k++) {
            bool event, terminates, early;
            double last, from = seconds();
            if (f_fmi3DoStep(units[k], n * dt, dt, true, &event, &terminates, &early, &last) > fmi3Warning) return 1;
            stepping += seconds() - from;
            for (int i = 7; i < argc; i++) {
                char kind;
                unsigned reference;
                size_t count;
                static double floats[MOST_VALUES];
                int64_t integer;
                bool truth;
                fmi3Binary bytes;
                if (sscanf(argv[i], "%c:%u:%zu", &kind, &reference, &count) != 3 || count > MOST_VALUES) return 2;
                fmi3ValueReference wanted[1] = {reference};
                if (kind == 'f' && f_fmi3GetFloat64(units[k], wanted, 1, floats, count) == fmi3OK)
                    print(floats, count * sizeof *floats);
                else if (kind == 'i' && f_fmi3GetInt64(units[k], wanted, 1, &integer, 1) == fmi3OK)
                    print(&integer, sizeof integer);
                else if (kind == 'b' && f_fmi3GetBoolean(units[k], wanted, 1, &truth, 1) == fmi3OK)
                    print(&truth, sizeof truth);
                else if (kind == 'p' && f_fmi3GetBinary(units[k], wanted, 1, &count, &bytes, 1) == fmi3OK)
                    print(bytes, count);
                else
                    return fprintf(stderr, "%s cannot be read\n", argv[i]), 1;
            }
            printf("\n");
        }
    }
    fprintf(stderr, "%.1f us a step\n", 1e6 * stepping / (steps * instances));
    for (int k = 0; k < instances; k++) f_fmi3FreeInstance(units[k]);
    return 0;
}
