/* The Helix arm, an FMI 2 unit, in a C program: pull its first tendon by 10 mm and watch the gripper for a second.
 *
 * The argument is the folder of the unpacked FMU. For brevity the program finds what it needs of modelDescription.xml
 * by text search and knows Linux's library only; a real host has an XML reader. fmi.h, in fmus/runtime, has the types
 * and functions of the standard, as do the standard's own headers.
 */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi.h"

#define LOAD(name) __typeof__(name) *f_##name = (__typeof__(name) *)dlsym(library, #name)

static char xml[1 << 20];

/* Return what stands between `before` and the next quotation mark. */
static const char *find(const char *before) {
    static char found[64];
    const char *at = strstr(xml, before);
    if (!at) fprintf(stderr, "no %s in modelDescription.xml\n", before), exit(2);
    snprintf(found, sizeof found, "%.*s", (int)strcspn(at + strlen(before), "\""), at + strlen(before));
    return found;
}

static fmi2ValueReference reference_of(const char *name) {
    char before[80];
    snprintf(before, sizeof before, "name=\"%s\" valueReference=\"", name);
    return (fmi2ValueReference)atoi(find(before));
}

static void log_message(fmi2ComponentEnvironment environment, fmi2String unit, fmi2Status status, fmi2String category,
                        fmi2String message, ...) {
    (void)environment, (void)status, (void)category;
    va_list values;
    va_start(values, message);
    fprintf(stderr, "%s: ", unit);
    vfprintf(stderr, message, values);
    fprintf(stderr, "\n");
    va_end(values);
}

int main(int argc, char **argv) {
    char path[4096];
    if (argc != 2) return fprintf(stderr, "%s FOLDER\n", argv[0]), 2;
    snprintf(path, sizeof path, "%s/modelDescription.xml", argv[1]);
    FILE *file = fopen(path, "rb");
    if (!file || fread(xml, 1, sizeof xml - 1, file) == 0) return perror(path), 2;
    fclose(file);

    snprintf(path, sizeof path, "%s/binaries/linux64/TendonArm.so", argv[1]);
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library) return fprintf(stderr, "%s\n", dlerror()), 2;
    LOAD(fmi2Instantiate);
    LOAD(fmi2SetupExperiment);
    LOAD(fmi2EnterInitializationMode);
    LOAD(fmi2ExitInitializationMode);
    LOAD(fmi2SetReal);
    LOAD(fmi2GetReal);
    LOAD(fmi2DoStep);
    LOAD(fmi2Terminate);
    LOAD(fmi2FreeInstance);

    char resources[4096 + 16];
    snprintf(resources, sizeof resources, "file://%s/resources", realpath(argv[1], path));
    fmi2CallbackFunctions callbacks = {.logger = log_message};
    fmi2Component arm = f_fmi2Instantiate("arm", fmi2CoSimulation, find("guid=\""), resources, &callbacks, 0, 0);
    if (!arm) return 1;

    fmi2ValueReference dl_t = reference_of("dl_t[1]");
    fmi2ValueReference p_WG[3] = {reference_of("p_WG[1]"), reference_of("p_WG[2]"), reference_of("p_WG[3]")};
    fmi2Real pull = -0.010, p[3], step = 0.02;
    int bad = f_fmi2SetupExperiment(arm, 0, 0.0, 0.0, 0, 0.0) || f_fmi2EnterInitializationMode(arm) ||
              f_fmi2SetReal(arm, &dl_t, 1, &pull) || f_fmi2ExitInitializationMode(arm);
    for (int k = 0; k < 50 && !bad; k++) bad = f_fmi2DoStep(arm, k * step, step, 1);
    if (!bad) bad = f_fmi2GetReal(arm, p_WG, 3, p) || f_fmi2Terminate(arm);
    if (!bad) printf("gripper at x = %.4f m, z = %.4f m\n", p[0], p[2]);
    f_fmi2FreeInstance(arm);
    return bad != 0;
}
