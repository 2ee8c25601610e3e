/* The loop over communication points, and the functions that Python calls. Calls are in the order of GridStepper. */
#include "plan.h"

#ifndef _WIN32
#include <unistd.h>
#endif

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "float_control.h"

#ifdef _WIN32
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif

API double plan_time(int64_t offset, uint64_t ticks, uint64_t numerator, uint64_t denominator) {
    return exact_time(offset, ticks, numerator, denominator);
}

API void plan_free_kept(Kept *kept, int64_t n) {
    for (int64_t i = 0; i < n; i++)
        free(kept[i].memory);
    memset(kept, 0, (size_t)n * sizeof *kept);
}

static enum outcome carry_out_all(Plan *plan, const Segment *segments, int64_t n, bool arriving) {
    for (int64_t i = 0; i < n; i++) {
        int64_t group = segments[i].group;
        if (group >= 0) {
            const Group *g = &plan->groups[group];
            if (g->due != plan->tick || (arriving && g->sampled && g->acted >= plan->tick))
                continue;
        }
        enum outcome outcome = carry_out(plan, &segments[i]);
        if (outcome != PAUSED)
            return outcome;
    }
    return PAUSED;
}

/* Undo what units have done to this thread's arithmetic; end a process that a unit has forked from this one. Once a
 * communication point, before its row is recorded: after each step it would cost a tenth of the loop. */
static void restore_arithmetic(Plan *plan) {
#ifndef _WIN32
    if (!*plan->identity)
        _exit(0);
#endif
    if (float_control() != plan->float_control)
        set_float_control(plan->float_control);
}

static enum outcome arrive(Plan *plan, int64_t last) {
    int64_t tick = last;
    for (int64_t i = 0; i < plan->n_groups; i++)
        if (plan->groups[i].due < tick)
            tick = plan->groups[i].due;
    plan->tick = tick;
    plan->time = exact_time(plan->offset, (uint64_t)tick, plan->numerator, plan->denominator);
    ((volatile double *)plan->heartbeat)[TIME] = plan->time;
    enum outcome outcome = carry_out_all(plan, plan->arrive, plan->n_arrive, true);
    if (outcome != PAUSED)
        return outcome;
    for (int64_t i = 0; i < plan->n_groups; i++)
        if (plan->groups[i].sampled && plan->groups[i].due == tick)
            plan->groups[i].acted = tick;
    return tick == last ? LAST_REACHED : PAUSED;
}

static enum outcome depart(Plan *plan) {
    enum outcome outcome = carry_out_all(plan, plan->depart, plan->n_depart, false);
    if (outcome != PAUSED)
        return outcome;
    for (int64_t i = 0; i < plan->n_groups; i++)
        if (plan->groups[i].due == plan->tick)
            plan->groups[i].due += plan->groups[i].every;
    return PAUSED;
}

/* Return whether the record is full. The row is counted only after it is written, so that a crash leaves whole rows. */
static bool add_row(const Plan *plan, const Record *record) {
    int64_t row = *record->filled;
    record->time[row] = plan->time;
    for (int64_t i = 0; i < record->n_parts; i++) {
        const Part *part = &record->parts[i];
        memcpy(part->rows + (size_t)row * part->bytes, part->values, part->bytes);
    }
    atomic_thread_fence(memory_order_release);
    *(volatile int64_t *)record->filled = row + 1;
    return row + 1 == record->capacity;
}

API int plan_arrive(Plan *plan, int64_t last) {
    plan->float_control = float_control();
    enum outcome outcome = arrive(plan, last);
    restore_arithmetic(plan);
    return outcome;
}

API int plan_depart(Plan *plan) {
    plan->float_control = float_control();
    enum outcome outcome = depart(plan);
    restore_arithmetic(plan);
    return outcome;
}

/* Carry out a part of the operations, as what is left of a communication step in which one stopped the plan. */
API int plan_carry_out(Plan *plan, int64_t first, int64_t end) {
    return carry_out(plan, &(Segment){-1, first, end});
}

/* Pass at most `points` communication points, tick `last` at the latest, with a row of the record at each. `leave` is
 * whether the plan is at a communication point to depart from first, as after every call but the first of a run. */
API int plan_run(Plan *plan, int64_t last, int64_t points, bool leave, const Record *record) {
    enum outcome outcome = PAUSED;
    plan->float_control = float_control();
    for (int64_t i = 0; i < points && outcome == PAUSED; i++) {
        outcome = leave ? depart(plan) : PAUSED;
        if (outcome == PAUSED)
            outcome = arrive(plan, last);
        restore_arithmetic(plan);
        leave = true;
        if (outcome > PAUSED)
            break;
        if (record && add_row(plan, record) && outcome == PAUSED)
            outcome = RECORD_FULL;
    }
    return outcome;
}
