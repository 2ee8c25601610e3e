/* What both standards share. */
#include "unit.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const Model *native_models[512];
size_t n_native_models;

void add_model(const Model *model) { native_models[n_native_models++] = model; }

void say(Unit *unit, enum status status, const char *format, ...) {
    char message[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    unit->log(unit, status, message);
}

size_t kept_size(const Unit *unit) { return sizeof(Kept) + 2 * unit->model->size; }

Unit *new_unit(const char *token, const char *name) {
    for (size_t i = 0; i < n_native_models; i++) {
        if (!token || strcmp(token, native_models[i]->name))
            continue;
        Unit *unit = calloc(1, sizeof *unit);
        unit->model = native_models[i];
        unit->kept = calloc(1, kept_size(unit));
        snprintf(unit->name, sizeof unit->name, "%s", name);
        begin(unit);
        return unit;
    }
    return NULL;
}

void free_unit(Unit *unit) {
    if (unit->model->freed)
        unit->model->freed(unit);
    free(unit->kept);
    free(unit);
}

void begin(Unit *unit) {
    memset(unit->kept, 0, kept_size(unit));
    unit->kept->mode = INSTANTIATED;
    unit->kept->stale = true;
    for (size_t i = 0; i < unit->model->n_variables; i++) {
        const Variable *v = &unit->model->variables[i];
        for (size_t j = 0; v->type == REAL && j < (v->length ? v->length : 1); j++)
            ((double *)place(unit, v))[j] = v->start;
        if (v->type == INTEGER || v->type == BOOLEAN)
            *(int32_t *)place(unit, v) = (int32_t)v->start;
    }
}

void set_up(Unit *unit, bool has_tolerance, double tolerance, double start, bool has_stop, double stop) {
    unit->kept->time = unit->kept->start = start;
    unit->kept->stop = has_stop ? stop : -1;
    unit->kept->tolerance = has_tolerance ? tolerance : -1;
}

bool allowed(Unit *unit, int modes, const char *call) {
    if (unit->kept->mode & modes)
        return true;
    say(unit, ERROR, "%s is not allowed in mode %d", call, unit->kept->mode);
    return false;
}

void *place(Unit *unit, const Variable *v) { return unit->kept->data + v->offset; }

static const Variable *named(Unit *unit, const char *name) {
    for (size_t i = 0; i < unit->model->n_variables; i++)
        if (!strcmp(unit->model->variables[i].name, name))
            return &unit->model->variables[i];
    return NULL;
}

/* Clocked variables are there while their Clock ticks; discrete inputs wait for Event Mode, if that is used. */
static bool reachable(Unit *unit, const Variable *v, bool to_set, const char *call) {
    int mode = unit->kept->mode;
    const Variable *clock = v->clock ? named(unit, v->clock) : NULL;
    if (clock && mode & (STEP | EVENT) && !*(int32_t *)place(unit, clock)) {
        say(unit, ERROR, "%s: %s is reached only while %s ticks", call, v->name, v->clock);
        return false;
    }
    if (to_set && unit->event_mode && mode == STEP && v->type != CLOCK && (v->discrete || v->type != REAL)) {
        say(unit, ERROR, "%s: %s is discrete, it is set in event mode", call, v->name);
        return false;
    }
    return true;
}

static const Variable *referenced(const Unit *unit, uint32_t reference, enum type type) {
    const Model *model = unit->model;
    if (unit->fmi == 3)
        return reference - 1u < model->n_variables ? &model->variables[reference - 1] : NULL;
    for (size_t i = 0; i < model->n_variables; i++)
        if (model->variables[i].type == (int)type && !--reference)
            return &model->variables[i];
    return NULL;
}

const Variable *variable(Unit *unit, uint32_t reference, enum type type, bool to_set, const char *call) {
    if (to_set && unit->model->set)
        unit->model->set(unit);
    const Variable *v = referenced(unit, reference, type);
    if (!v || v->type != (int)type || (to_set && v->causality == OUTPUT)) {
        say(unit, ERROR, "%s: there is no such variable with value reference %u", call, (unsigned)reference);
        return NULL;
    }
    int tuned = unit->model->abilities & TUNABLE_PARAMETERS ? (unit->event_mode ? EVENT : STEP) : 0;
    if (to_set && v->causality == PARAMETER && !allowed(unit, INSTANTIATED | INITIALIZATION | tuned, call))
        return NULL;
    if (!to_set && v->causality == PARAMETER && unit->model->abilities & SECRET_PARAMETERS) {
        say(unit, ERROR, "%s: %s cannot be read", call, v->name);
        return NULL;
    }
    if (!reachable(unit, v, to_set, call))
        return NULL;
    if (to_set)
        unit->kept->stale = true;
    return v;
}

double input_at(Unit *unit, const double *field, double since) {
    size_t offset = (size_t)((const unsigned char *)field - unit->kept->data);
    for (size_t i = 0; i < unit->model->n_variables; i++)
        if (unit->model->variables[i].offset == offset) {
            const double *rates = unit->kept->rates[i];
            return *field + since * (rates[0] + since * rates[1] / 2);
        }
    return *field;
}

/* Outputs are computed when they are asked for: current in every mode, after inputs were set too. */
void refresh(Unit *unit) {
    if (unit->kept->stale && unit->model->outputs)
        unit->model->outputs(unit);
    unit->kept->stale = false;
}

enum status do_step(Unit *unit, double t, double h, StepEnd *end) {
    Kept *kept = unit->kept;
    const Model *model = unit->model;
    *end = (StepEnd){.last_time = t + h};
    if (!allowed(unit, STEP, "doStep"))
        return ERROR;
    if (fabs(t - kept->time) > 1e-9 * fmax(1, fabs(t)) || !(h > 0)) {
        say(unit, ERROR, "a step from %.17g by %g; the unit is at %.17g", t, h, kept->time);
        return ERROR;
    }
    if (model->abilities & FIXED_STEP && fabs(h - model->proposed_step) > 1e-9) {
        say(unit, ERROR, "a step of %g s; this unit takes steps of %g s", h, model->proposed_step);
        return ERROR;
    }
    if (model->abilities & DERIVATIVES)
        memcpy(kept->data + model->size, kept->data, model->size);
    enum status status = model->step ? model->step(unit, t, h, end) : OK;
    kept->last_time = end->last_time;
    kept->terminated = end->terminate;
    if (status <= DISCARD) {
        kept->time = end->last_time;
        kept->last_step = end->last_time - t;
        kept->stale = true;
    }
    return status;
}

/* Units with this ability are linear: one more step with the inputs changed by the seed tells, and is exact. */
static void reach(Unit *unit, const Unit *from, const uint32_t *known, size_t m, const double *seed) {
    Kept *kept = unit->kept;
    size_t size = unit->model->size;
    memcpy(kept, from->kept, kept_size(from));
    if (kept->last_step > 0)
        memcpy(kept->data, kept->data + size, size);
    for (size_t i = 0; i < m; i++)
        *(double *)place(unit, referenced(from, known[i], REAL)) += seed[i];
    StepEnd end = {0};
    if (kept->last_step > 0 && unit->model->step)
        unit->model->step(unit, kept->time - kept->last_step, kept->last_step, &end);
    kept->stale = true;
    refresh(unit);
}

/* How outputs at this communication point change with the inputs that the last step held; before any step, at once. */
enum status sensitivity(Unit *unit, const uint32_t *unknown, size_t n, const uint32_t *known, size_t m,
                        const double *seed, double *change) {
    if (!(unit->model->abilities & DERIVATIVES))
        return ERROR;
    for (size_t i = 0; i < n + m; i++)
        if (!variable(unit, i < n ? unknown[i] : known[i - n], REAL, false, "GetDirectionalDerivative"))
            return ERROR;
    Unit *here = new_unit(unit->model->name, unit->name), *there = new_unit(unit->model->name, unit->name);
    here->log = there->log = unit->log;
    reach(here, unit, NULL, 0, NULL);
    reach(there, unit, known, m, seed);
    for (size_t i = 0; i < n; i++) {
        const Variable *v = referenced(unit, unknown[i], REAL);
        change[i] = *(double *)place(there, v) - *(double *)place(here, v);
    }
    free_unit(here);
    free_unit(there);
    return OK;
}

enum status save(Unit *unit, void **state) {
    if (unit->model->abilities & NO_STATES) {
        say(unit, ERROR, "this unit cannot save its state");
        return ERROR;
    }
    if (!*state)
        *state = malloc(kept_size(unit));
    memcpy(*state, unit->kept, kept_size(unit));
    return OK;
}

enum status restore(Unit *unit, const void *state) {
    if (!state || unit->model->abilities & NO_STATES)
        return ERROR;
    memcpy(unit->kept, state, kept_size(unit));
    return OK;
}
