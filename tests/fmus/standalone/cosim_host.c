/* Steps a unit of FMI 2 alone in libcosim, through its interface in C, and prints its outputs, a line a step.
 *
 * Arguments: the library libcosimc, the FMU, the step in ns, the number of steps, value references of real outputs.
 */
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#define MOST_VALUES 64
#define ONLY_ERRORS 4 /* a level of libcosim's log, which goes to the standard output */

static void *library;

static void *function(const char *name) {
    void *found = dlsym(library, name);
    if (!found) exit((fprintf(stderr, "libcosimc has no %s\n", name), 2));
    return found;
}

static void check(int done) {
    if (!done) exit((fprintf(stderr, "%s\n", ((const char *(*)(void))function("cosim_last_error_message"))()), 1));
}

int main(int argc, char **argv) {
    uint32_t references[MOST_VALUES];
    double values[MOST_VALUES];
    size_t n = 0;
    if (argc < 6 || argc - 5 > MOST_VALUES) return 2;
    for (int i = 5; i < argc; i++) references[n++] = (uint32_t)strtoul(argv[i], NULL, 10);
    library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) return fprintf(stderr, "%s\n", dlerror()), 2;
    ((void (*)(int))function("cosim_log_set_output_level"))(ONLY_ERRORS);
    void *execution = ((void *(*)(int64_t, int64_t))function("cosim_execution_create"))(0, atoll(argv[3]));
    check(execution != NULL);
    void *unit = ((void *(*)(const char *, const char *))function("cosim_local_slave_create"))(argv[2], "unit");
    check(unit != NULL);
    int number = ((int (*)(void *, void *))function("cosim_execution_add_slave"))(execution, unit);
    check(number >= 0);
    void *observer = ((void *(*)(void))function("cosim_last_value_observer_create"))();
    check(((int (*)(void *, void *))function("cosim_execution_add_observer"))(execution, observer) == 0);
    int (*step)(void *, size_t) = function("cosim_execution_step");
    int (*get)(void *, int, const uint32_t *, size_t, double *) = function("cosim_observer_slave_get_real");
    for (int k = 0; k < atoi(argv[4]); k++) {
        check(step(execution, 1) == 0);
        check(get(observer, number, references, n, values) == 0);
        for (size_t i = 0; i < n; i++) printf("%a ", values[i]);
        printf("\n");
    }
    check(((int (*)(void *))function("cosim_execution_destroy"))(execution) == 0);
    ((int (*)(void *))function("cosim_local_slave_destroy"))(unit);
    ((int (*)(void *))function("cosim_observer_destroy"))(observer);
    return 0;
}
