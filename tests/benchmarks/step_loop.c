/* The loops that test_runtime_speed.py times: set, step, get as a host in C does it. Returns CPU seconds a round. */
#include <string.h>
#include <time.h>

#include "fmi.h"

#define N_INPUTS 12
#define N_OUTPUTS 13

static double cpu(void) {
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

typedef fmi2Status Set2(fmi2Component, const fmi2ValueReference *, size_t, const fmi2Real *);
typedef fmi2Status Get2(fmi2Component, const fmi2ValueReference *, size_t, fmi2Real *);
typedef fmi2Status Step2(fmi2Component, fmi2Real, fmi2Real, fmi2Boolean);
typedef fmi3Status Set3(fmi3Instance, const fmi3ValueReference *, size_t, const fmi3Float64 *, size_t);
typedef fmi3Status Get3(fmi3Instance, const fmi3ValueReference *, size_t, fmi3Float64 *, size_t);
typedef fmi3Status Step3(fmi3Instance, fmi3Float64, fmi3Float64, fmi3Boolean, fmi3Boolean *, fmi3Boolean *,
                         fmi3Boolean *, fmi3Float64 *);

static void inputs_of(double u[N_INPUTS], int k) {
    for (int i = 0; i < N_INPUTS; i++) u[i] = k + 0.5 * i;
}

FMI_EXPORT double loop2(Set2 *set, Step2 *step, Get2 *get, void *c, const uint32_t *in, const uint32_t *out, double t,
                        double dt, int rounds, double *y) {
    double u[N_INPUTS], begin = cpu();
    int bad = 0;
    for (int k = 0; k < rounds; k++, t += dt) {
        inputs_of(u, k);
        bad |= set(c, in, N_INPUTS, u) | step(c, t, dt, 0) | get(c, out, N_OUTPUTS, y);
    }
    return bad ? -1.0 : (cpu() - begin) / rounds;
}

FMI_EXPORT double loop3(Set3 *set, Step3 *step, Get3 *get, void *c, const uint32_t *in, const uint32_t *out, double t,
                        double dt, int rounds, double *y) {
    double u[N_INPUTS], last, begin = cpu();
    bool event, end, early;
    int bad = 0;
    for (int k = 0; k < rounds; k++, t += dt) {
        inputs_of(u, k);
        bad |= set(c, in, N_INPUTS, u, N_INPUTS) | step(c, t, dt, false, &event, &end, &early, &last) |
               get(c, out, N_OUTPUTS, y, N_OUTPUTS);
    }
    return bad ? -1.0 : (cpu() - begin) / rounds;
}

typedef fmi3Status SetBytes(fmi3Instance, const fmi3ValueReference *, size_t, const size_t *, const fmi3Binary *,
                            size_t);
typedef fmi3Status GetBytes(fmi3Instance, const fmi3ValueReference *, size_t, size_t *, fmi3Binary *, size_t);

FMI_EXPORT double copy_loop(uint8_t *to, const uint8_t *from, size_t size, int rounds) {
    double begin = cpu();
    for (int k = 0; k < rounds; k++) {
        memcpy(to, from, size);
        __asm__ volatile("" : : "r"(to) : "memory");
    }
    return (cpu() - begin) / rounds;
}

FMI_EXPORT double set_loop(SetBytes *set, void *c, uint32_t reference, const uint8_t *from, size_t size, int rounds) {
    double begin = cpu();
    fmi3Binary value = from;
    int bad = 0;
    for (int k = 0; k < rounds; k++) bad |= set(c, &reference, 1, &size, &value, 1);
    return bad ? -1.0 : (cpu() - begin) / rounds;
}

FMI_EXPORT double get_loop(GetBytes *get, void *c, uint32_t reference, int rounds, const uint8_t **place) {
    double begin = cpu();
    size_t size;
    int bad = 0;
    for (int k = 0; k < rounds; k++) bad |= get(c, &reference, 1, &size, place, 1);
    return bad ? -1.0 : (cpu() - begin) / rounds;
}
