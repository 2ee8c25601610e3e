/* Partial derivatives of the real outputs by the real inputs, where the block offers them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "derivatives.h"
#include "lifecycle.h"
#include "log.h"
#include "slave.h"
#include "variables.h"

#define NOT_PROVIDED "the block has no directional_derivative; modelDescription.xml says that none are provided"

/* Adds the variables' entries to `count`. */
static bool are(const Instance *instance, const char *function, Causality causality, const uint32_t references[],
                size_t n, size_t *count) {
    const char *what = causality == INPUT ? "known" : "unknown", *wanted = causality == INPUT ? "input" : "output";
    if (n > 0 && !given(instance, function, references, causality == INPUT ? "knowns" : "unknowns")) return false;
    for (size_t i = 0; i < n; i++) {
        bool fits = references[i] < instance->n_variables;
        const Variable *variable = fits ? variable_of(instance, references[i]) : NULL;
        if (!fits || variable->kind != FLOAT64 || variable->causality != causality) {
            refuse(instance, function, "the %s with value reference %u is no real %s: derivatives are those of real "
                   "outputs by real inputs", what, references[i], wanted);
            return false;
        }
        *count += variable->count;
    }
    return true;
}

static bool fits(const Instance *instance, const char *function, const char *what, const double values[], size_t n,
                 size_t wanted) {
    if (wanted > 0 && !given(instance, function, values, what)) return false;
    if (n == wanted) return true;
    refuse(instance, function, "%zu values of %s for variables with %zu entries", n, what, wanted);
    return false;
}

/* Between values in the order of the host's references and all of one causality as they lie in `floats`. */
static void scatter(const Instance *instance, size_t first, const uint32_t references[], size_t n,
                    const double values[], double all[]) {
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = variable_of(instance, references[i]);
        for (size_t j = 0; j < variable->count; j++) all[variable->offset - first + j] += *values++;
    }
}

static void gather(const Instance *instance, size_t first, const uint32_t references[], size_t n, const double all[],
                   double values[]) {
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = variable_of(instance, references[i]);
        memcpy(values, all + (variable->offset - first), variable->count * sizeof *values);
        values += variable->count;
    }
}

static Status derive(Instance *instance, const char *function, const double du[], double dy[]) {
    if (slave_derivative(instance, function, du, dy) != STATUS_OK) return STATUS_ERROR;
    for (size_t i = 0; i < instance->n_outputs; i++)
        if (!isfinite(dy[i])) return refuse(instance, function, "the block gave a derivative that is %g", dy[i]);
    return STATUS_OK;
}

/* seed J, a column of J at a time: for an input entry e, (J e) weighed with the seed. */
static Status derive_adjoint(Instance *instance, const char *function, const double weights[], double du[],
                             double dy[], double result[]) {
    for (size_t i = 0; i < instance->n_inputs; i++) {
        du[i] = 1.0;
        if (derive(instance, function, du, dy) != STATUS_OK) return STATUS_ERROR;
        du[i] = 0.0;
        result[i] = 0.0;
        for (size_t j = 0; j < instance->n_outputs; j++) result[i] += weights[j] * dy[j];
    }
    return STATUS_OK;
}

Status get_derivative(Instance *instance, const char *function, bool adjoint, const uint32_t unknowns[],
                      size_t n_unknowns, const uint32_t knowns[], size_t n_knowns, const double seed[], size_t n_seed,
                      double sensitivity[], size_t n_sensitivity) {
    if (!allowed(instance, function, INITIALISATION | EVENT | STEPPING | TERMINATED)) return STATUS_ERROR;
    if (!(instance->abilities & HAS_DERIVATIVES)) return refuse_unsupported(instance, function, NOT_PROVIDED);
    size_t inputs = 0, outputs = 0;
    if (!are(instance, function, OUTPUT, unknowns, n_unknowns, &outputs) ||
        !are(instance, function, INPUT, knowns, n_knowns, &inputs) ||
        !fits(instance, function, "seed", seed, n_seed, adjoint ? outputs : inputs) ||
        !fits(instance, function, "sensitivity", sensitivity, n_sensitivity, adjoint ? inputs : outputs))
        return STATUS_ERROR;
    for (size_t i = 0; i < n_seed; i++)
        if (!isfinite(seed[i])) return refuse(instance, function, "entry %zu of seed is %g", i + 1, seed[i]);
    if (!inputs_finite(instance, function) || instance_refresh_outputs(instance, function) != STATUS_OK)
        return STATUS_ERROR;
    size_t nu = instance->n_inputs, ny = instance->n_outputs;
    double *du = calloc(2 * nu + 2 * ny + 1, sizeof *du), *dy = du + nu, *weights = dy + ny, *result = weights + ny;
    if (!du) return refuse(instance, function, "no memory for %zu derivatives", nu + ny);
    Status status;
    if (adjoint) {
        scatter(instance, instance->first_output, unknowns, n_unknowns, seed, weights);
        status = derive_adjoint(instance, function, weights, du, dy, result);
        if (status == STATUS_OK) gather(instance, instance->first_input, knowns, n_knowns, result, sensitivity);
    } else {
        scatter(instance, instance->first_input, knowns, n_knowns, seed, du);
        status = derive(instance, function, du, dy);
        if (status == STATUS_OK) gather(instance, instance->first_output, unknowns, n_unknowns, dy, sensitivity);
    }
    free(du);
    return status;
}
