/* A host that is not Python and knows no unit: it makes the calls that a file lists, and prints what it gets.
 *
 * Arguments: version of FMI (2 or 3), library, GUID or instantiation token, resources (FMI 2: URI, FMI 3: path), file.
 * Calls, a line each, with value references, numbers of values and files of bytes:
 *     set real|integer|integer32|boolean REFERENCE N VALUE...     set binary REFERENCE FILE
 *     get real|integer|integer32|boolean REFERENCE N              get binary REFERENCE FILE
 *     initialise                                                  step TIME SIZE
 * `get` prints its values on one line, with all digits; of bytes it prints how many it has written to the file.
 *
 * `cycle` begins calls that `repeat TIMES` makes again, time going on and nothing printed; then it prints `repeated` and
 * waits for a line, so that others can see what the calls have cost.
 */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi.h"

#define MOST 1024
#define LOAD(name)                                                                                                     \
    static __typeof__(name) *f_##name;                                                                                 \
    if (!f_##name) f_##name = (__typeof__(name) *)find(#name)

/* A call of the file; of `set` and `get` with room for the numbers, or with the bytes. */
typedef struct {
    char what[16], type[16], path[4096];
    unsigned reference;
    size_t n;
    double *values;
    uint8_t *bytes;
    double t, size;
} Call;

static void *library, *unit;
static int is_fmi2, is_quiet;

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

static void transfer_bytes(const Call *c) {
    if (!strcmp(c->what, "set")) {
        LOAD(fmi3SetBinary);
        const uint8_t *given = c->bytes;
        expect_ok(f_fmi3SetBinary(unit, &c->reference, 1, &c->n, &given, 1), "set binary");
        return;
    }
    LOAD(fmi3GetBinary);
    const uint8_t *bytes;
    size_t size;
    expect_ok(f_fmi3GetBinary(unit, &c->reference, 1, &size, &bytes, 1), "get binary");
    if (is_quiet) return;
    FILE *file = fopen(c->path, "wb");
    if (!file) printf("no file %s\n", c->path), exit(2);
    if (fwrite(bytes, 1, size, file) != size) exit(2);
    fclose(file);
    printf("%zu\n", size);
}

static void transfer(const Call *c) {
    int is_set = !strcmp(c->what, "set");
    if (!strcmp(c->type, "real")) {
        TRANSFER(is_set, c->reference, c->n, c->values, double, Real, double, Float64)
    } else if (!strcmp(c->type, "integer")) {
        TRANSFER(is_set, c->reference, c->n, c->values, int, Integer, int64_t, Int64)
    } else if (!strcmp(c->type, "integer32")) {
        TRANSFER(is_set, c->reference, c->n, c->values, int, Integer, int32_t, Int32)
    } else if (!strcmp(c->type, "boolean")) {
        TRANSFER(is_set, c->reference, c->n, c->values, int, Boolean, bool, Boolean)
    } else {
        exit(2);
    }
    for (size_t i = 0; !is_set && !is_quiet && i < c->n; i++) printf(i + 1 < c->n ? "%.17g " : "%.17g\n", c->values[i]);
}

static void make(const Call *c) {
    if (!strcmp(c->what, "initialise"))
        initialise();
    else if (!strcmp(c->what, "step"))
        step(c->t, c->size);
    else if (!strcmp(c->type, "binary"))
        transfer_bytes(c);
    else
        transfer(c);
}

static void read_bytes(Call *c) {
    FILE *file = fopen(c->path, "rb");
    if (!file) printf("no file %s\n", c->path), exit(2);
    fseek(file, 0, SEEK_END);
    c->n = (size_t)ftell(file);
    rewind(file);
    c->bytes = malloc(c->n);
    if (fread(c->bytes, 1, c->n, file) != c->n) exit(2);
    fclose(file);
}

/* Read what follows a call's first word. */
static void read_call(FILE *calls, Call *c) {
    if (!strcmp(c->what, "initialise")) return;
    if (!strcmp(c->what, "step")) {
        if (fscanf(calls, "%lf %lf", &c->t, &c->size) != 2) exit(2);
        return;
    }
    if (fscanf(calls, "%15s %u", c->type, &c->reference) != 2) exit(2);
    int is_set = !strcmp(c->what, "set");
    if (!strcmp(c->type, "binary")) {
        if (fscanf(calls, " %4095[^\n]", c->path) != 1) exit(2);
        if (is_set) read_bytes(c);
        return;
    }
    if (fscanf(calls, "%zu", &c->n) != 1 || c->n > MOST) exit(2);
    c->values = calloc(c->n, sizeof *c->values);
    for (size_t i = 0; is_set && i < c->n; i++)
        if (fscanf(calls, "%lf", &c->values[i]) != 1) exit(2);
}

/* Make the calls of the cycle again, from time t on; return the time that is reached. */
static double repeat(Call *const *cycle, size_t size, size_t times, double t) {
    is_quiet = 1;
    for (size_t k = 0; k < times; k++)
        for (size_t i = 0; i < size; i++) {
            if (!strcmp(cycle[i]->what, "step")) cycle[i]->t = t, t += cycle[i]->size;
            make(cycle[i]);
        }
    is_quiet = 0;
    printf("repeated\n");
    fflush(stdout);
    for (int c = getchar(); c != '\n' && c != EOF;) c = getchar();
    return t;
}

int main(int argc, char **argv) {
    if (argc != 6) return 2;
    is_fmi2 = !strcmp(argv[1], "2");
    library = dlopen(argv[2], RTLD_NOW | RTLD_LOCAL);
    if (!library) return printf("%s\n", dlerror()), 2;
    instantiate(argv[3], argv[4]);
    FILE *calls = fopen(argv[5], "r");
    if (!calls) return 2;
    Call **cycle = NULL;
    size_t size = 0, times;
    int is_cycle = 0;
    double t = 0.0;
    for (Call *c = calloc(1, sizeof *c); fscanf(calls, "%15s", c->what) == 1; c = calloc(1, sizeof *c)) {
        if (!strcmp(c->what, "cycle")) {
            is_cycle = 1;
        } else if (!strcmp(c->what, "repeat")) {
            if (fscanf(calls, "%zu", &times) != 1) return 2;
            t = repeat(cycle, size, times, t);
        } else {
            read_call(calls, c);
            make(c);
            if (!strcmp(c->what, "step")) t = c->t + c->size;
            if (is_cycle) {
                cycle = realloc(cycle, (size + 1) * sizeof *cycle);
                cycle[size++] = c;
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
