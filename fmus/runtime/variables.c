/* What an instance knows of its variables, and whether their values are usable numbers: the table that fmus/table.py
 * writes, and checks of all inputs or outputs.
 *
 * It stands below whatever calls into Python: starting Python, wherever it runs, ends with taking its table over. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "log.h"
#include "text.h"
#include "variables.h"

bool take_table(Instance *instance, const char *bytes, size_t size, uint64_t shift) {
    TableHeader header;
    char *table = malloc(size);
    if (!table) return false;
    memcpy(table, bytes, size);
    memcpy(&header, bytes, sizeof header);
    free(instance->table);
    instance->table = table;
    BinaryBuffer *binaries = (BinaryBuffer *)(table + sizeof header);
    for (uint64_t i = 0; i < header.binaries; i++) binaries[i].address += shift;
    instance->binaries = binaries;
    instance->variables = (const Variable *)(binaries + header.binaries);
    instance->n_variables = header.variables;
    instance->names = (const char *)(instance->variables + header.variables);
    instance->floats = (double *)(uintptr_t)(header.floats + shift);
    instance->integers = (int64_t *)(uintptr_t)(header.integers + shift);
    instance->booleans = (uint8_t *)(uintptr_t)(header.booleans + shift);
    instance->sizes = (uint64_t *)(uintptr_t)(header.sizes + shift);
    instance->first_input = header.first_input;
    instance->n_inputs = header.inputs;
    instance->first_output = header.first_output;
    instance->n_outputs = header.outputs;
    instance->gives_singles = false;
    for (size_t i = 0; i < instance->n_variables; i++)
        if (instance->variables[i].causality == OUTPUT && instance->variables[i].type == TYPE_FLOAT32)
            instance->gives_singles = true;
    instance->abilities = header.abilities;
    instance->period_counter = header.period_counter;
    instance->period_resolution = header.period_resolution;
    return true;
}

static void describe_bad(const Instance *instance, size_t at, Text *description) {
    for (size_t i = 0; i < instance->n_variables; i++) {
        const Variable *v = &instance->variables[i];
        if (v->kind != FLOAT64 || at < v->offset || at >= (size_t)v->offset + v->count) continue;
        const char *what = v->causality == OUTPUT ? "output" : "input";
        text_add(description, "%s '%s' is %g", what, name_of(instance, v), instance->floats[at]);
        if (v->count > 1) text_add(description, " (entry %zu of %u)", at - v->offset + 1, v->count);
        return;
    }
}

/* Whether one of `n` real entries is not finite; the first is described. */
static bool find_not_finite(const Instance *instance, size_t first, size_t n, Text *description) {
    for (size_t i = first; i < first + n; i++) {
        if (isfinite(instance->floats[i])) continue;
        describe_bad(instance, i, description);
        return true;
    }
    return false;
}

/* The same for a Float32 output that no Float32 holds. */
static bool find_beyond_single(const Instance *instance, Text *description) {
    for (size_t i = 0; i < instance->n_variables; i++) {
        const Variable *v = &instance->variables[i];
        if (v->causality != OUTPUT || v->type != TYPE_FLOAT32) continue;
        for (size_t at = v->offset; at < (size_t)v->offset + v->count; at++) {
            if (fabs(instance->floats[at]) <= FLT_MAX) continue;
            describe_bad(instance, at, description);
            text_add(description, "; it is declared as Float32, up to %g", FLT_MAX);
            return true;
        }
    }
    return false;
}

static void refuse_text(const Instance *instance, const char *function, Text *bad) {
    refuse(instance, function, "%s", text_of(bad));
    text_clear(bad);
}

bool inputs_finite(const Instance *instance, const char *function) {
    Text bad = {0};
    bool found = find_not_finite(instance, instance->first_input, instance->n_inputs, &bad);
    if (found) refuse_text(instance, function, &bad);
    return !found;
}

Status check_outputs(Instance *instance, const char *function) {
    Text bad = {0};
    bool found = find_not_finite(instance, instance->first_output, instance->n_outputs, &bad) ||
                 (instance->gives_singles && find_beyond_single(instance, &bad));
    if (!found) return STATUS_OK;
    refuse_text(instance, function, &bad);
    instance->mode = FAILED;
    return STATUS_ERROR;
}
