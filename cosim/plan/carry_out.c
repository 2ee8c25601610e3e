/* Executes operations, one after another. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cpu_clock.h"
#include "plan.h"

typedef int (*Access2)(void *, const uint32_t *, size_t, void *);
typedef int (*Access3)(void *, const uint32_t *, size_t, void *, size_t);
typedef int (*Binaries3)(void *, const uint32_t *, size_t, size_t *, void *, size_t);
typedef int (*Step2)(void *, double, double, int);
typedef int (*Step3)(void *, double, double, bool, bool *, bool *, bool *, double *);

enum { OK, WARNING };

#define LOAD(ENUM, T)                                                                                                  \
    case ENUM: {                                                                                                       \
        T value;                                                                                                       \
        memcpy(&value, (const T *)from + i, sizeof value);                                                             \
        return value;                                                                                                  \
    }
#define STORE(ENUM, T)                                                                                                 \
    case ENUM: {                                                                                                       \
        T made = (T)value;                                                                                             \
        memcpy((T *)to + i, &made, sizeof made);                                                                       \
        return;                                                                                                        \
    }

/* An unsigned integer of 64 bits is returned with the same bits. */
static int64_t integer(const void *from, int type, size_t i) {
    switch (type) {
        LOAD(BOOL8, uint8_t)
        LOAD(INT8, int8_t)
        LOAD(INT16, int16_t)
        LOAD(INT32, int32_t)
        LOAD(INT64, int64_t)
        LOAD(UINT8, uint8_t)
        LOAD(UINT16, uint16_t)
        LOAD(UINT32, uint32_t)
    default: {
        uint64_t value;
        memcpy(&value, (const uint64_t *)from + i, sizeof value);
        return (int64_t)value;
    }
    }
}

static void store_integer(void *to, int type, size_t i, int64_t value) {
    switch (type) {
    case BOOL8:
        ((uint8_t *)to)[i] = value != 0;
        return;
        STORE(INT8, int8_t)
        STORE(INT16, int16_t)
        STORE(INT32, int32_t)
        STORE(INT64, int64_t)
        STORE(UINT8, uint8_t)
        STORE(UINT16, uint16_t)
        STORE(UINT32, uint32_t)
        STORE(UINT64, uint64_t)
    }
}

static double real(const void *from, int type, size_t i) {
    return type == FLOAT32 ? (double)((const float *)from)[i] : ((const double *)from)[i];
}

static void store_real(void *to, int type, size_t i, double value) {
    if (type == FLOAT32)
        ((float *)to)[i] = (float)value;
    else
        ((double *)to)[i] = value;
}

static void convert(const Operation *o) {
    bool reals = o->copy.from_type >= FLOAT32;
    for (size_t i = 0; i < o->copy.n; i++)
        if (reals)
            store_real(o->copy.to, o->copy.to_type, i, real(o->copy.from, o->copy.from_type, i));
        else
            store_integer(o->copy.to, o->copy.to_type, i, integer(o->copy.from, o->copy.from_type, i));
}

static void scale(const Operation *o) {
#pragma STDC FP_CONTRACT OFF
    for (size_t i = 0; i < o->copy.n; i++) {
        double scaled = real(o->copy.from, o->copy.from_type, i) * o->copy.factor;
        store_real(o->copy.to, o->copy.to_type, i, scaled + o->copy.offset);
    }
}

static bool fits(const Operation *o) {
    for (size_t i = 0; i < o->check.n; i++) {
        int64_t value = integer(o->check.values, (int)o->check.type, i);
        if (o->check.type == UINT64 && value < 0) {
            if ((uint64_t)value > o->check.high)
                return false;
        } else if (value < o->check.low || (value > 0 && (uint64_t)value > o->check.high))
            return false;
    }
    return true;
}

/* Where a number is infinite or NaN, all bits of its exponent are set, and one more carries into the sign's. This is done
 * with integers, since a unit may have had floating-point operations trap. Vectorised it takes longer for a few numbers,
 * which is what most units give. */
static bool values_are_finite(const Operation *o) {
    const char *values = o->check.values;
    if (o->check.type == FLOAT32) {
        uint32_t carried = 0;
#pragma clang loop vectorize(disable) unroll(disable)
        for (size_t i = 0; i < o->check.n; i++) {
            uint32_t bits;
            memcpy(&bits, values + i * sizeof bits, sizeof bits);
            carried |= (bits & 0x7f800000u) + 0x00800000u;
        }
        return !(carried >> 31);
    }
    uint64_t carried = 0;
#pragma clang loop vectorize(disable) unroll(disable)
    for (size_t i = 0; i < o->check.n; i++) {
        uint64_t bits;
        memcpy(&bits, values + i * sizeof bits, sizeof bits);
        carried |= (bits & 0x7ff0000000000000u) + 0x0010000000000000u;
    }
    return !(carried >> 63);
}

/* Copy texts or binaries; those that lie in memory which a unit's process shares are only looked at. */
static bool keep(const Operation *o) {
    for (size_t i = 0; i < o->keep.n; i++) {
        const void *given = o->keep.addresses[i];
        bool text = o->kind == KEEP_TEXTS;
        size_t size = !text ? o->keep.sizes[i] : given ? strlen(given) + 1 : 1;
        if (!given && size && !text)
            return false;
        if (!o->keep.kept)
            continue;
        Kept *kept = &o->keep.kept[i];
        if (kept->size < size || !kept->memory) {
            void *larger = realloc(kept->memory, size ? size : 1);
            if (!larger)
                return false;
            kept->memory = larger;
            kept->size = size;
        }
        if (given && size)
            memcpy(kept->memory, given, size);
        else if (text)
            *(char *)kept->memory = 0;
        o->keep.addresses[i] = kept->memory;
    }
    return true;
}

/* Whether a step of FMI 3 reached its end, or came as near to it as `time_reached` in calls.py accepts. */
static bool return_is_valid(const Operation *o, double t) {
#pragma STDC FP_CONTRACT OFF
    double last = *o->step.last_time, end = t + o->step.step;
    if (*o->step.terminate)
        return false;
    if (last == end)
        return true;
    double slack = 1e-3 * o->step.step + 16 * DBL_EPSILON * fabs(end);
    /* quiet comparisons: NaN must not trap */
    return isgreaterequal(last, (*o->step.early ? end : t) - slack) && islessequal(last, end + slack);
}

static int step(Plan *plan, const Operation *o, bool *well) {
    double t = plan->time;
    plan->unit_times[o->unit] = t;
    int status;
    if (o->kind == STEP_2)
        status = ((Step2)o->step.function)(o->step.component, t, o->step.step, true);
    else {
        *o->step.event_needed = *o->step.terminate = *o->step.early = false; /* what a unit leaves as it is */
        *o->step.last_time = t + o->step.step;
        status = ((Step3)o->step.function)(o->step.component, t, o->step.step, true, o->step.event_needed,
                                           o->step.terminate, o->step.early, o->step.last_time);
        *well = return_is_valid(o, t);
    }
    if ((unsigned)status <= WARNING && *well)
        plan->unit_times[o->unit] = t + o->step.step;
    return status;
}

static void begin_step(const Plan *plan, const Operation *o) {
    ((void (*)(void *, double, double, int))o->step.function)(o->step.component, plan->time, o->step.step, true);
}

static void charge(Plan *plan, const Operation *o) {
    double now = cpu_clock(), spent = now - plan->clock;
    if (o->charge.own) {
        spent += *o->charge.own >= 0 && isfinite(*o->charge.own) ? *o->charge.own : 0; /* the unit may write there */
        *o->charge.own = 0;
    }
    plan->spent[o->unit * plan->spent_capacity + plan->n_spent[o->unit]++] = spent;
    plan->clock = now;
}

/* Never inlined, which would cost the loop registers. */
__attribute__((noinline, cold)) static void count_warning(Plan *plan, int64_t operation) {
    Warned *warned = &plan->warned[operation];
    if (!warned->n++)
        warned->first = ((volatile double *)plan->heartbeat)[TIME];
}

/* Return PAUSED if all succeeded, else STOPPED, with the operation and its status in the plan; ABANDONED if the units
 * were taken from this thread while it was in a call. */
enum outcome carry_out(Plan *plan, const Segment *segment) {
    const Operation *all = plan->operations, *end = all + segment->end;
    volatile int64_t *heartbeat = plan->heartbeat;
    enum outcome outcome = PAUSED;
    for (const Operation *o = all + segment->first; o < end; o++) {
        int status = OK;
        bool well = true;
        if (o->code >= 0) {
            heartbeat[COUNT] += 1;
            heartbeat[DOING] = o->code;
            ((volatile double *)heartbeat)[TIME] = plan->unit_times[o->unit];
        }
        switch (o->kind) {
        case COPY:
            if (o->copy.n == sizeof(double))
                memcpy(o->copy.to, o->copy.from, sizeof(double));
            else
                memcpy(o->copy.to, o->copy.from, o->copy.n);
            break;
        case ACCESS_2:
            status = ((Access2)o->access.function)(o->access.component, o->access.references, o->access.n_references,
                                                   o->access.values);
            break;
        case ACCESS_3:
            status = ((Access3)o->access.function)(o->access.component, o->access.references, o->access.n_references,
                                                   o->access.values, o->access.n_values);
            break;
        case BINARIES_3:
            status = ((Binaries3)o->access.function)(o->access.component, o->access.references, o->access.n_references,
                                                     o->access.sizes, o->access.values, o->access.n_values);
            break;
        case STEP_2:
        case STEP_3:
            status = step(plan, o, &well);
            break;
        case BEGIN_STEP:
            begin_step(plan, o);
            break;
        case CONVERT:
            convert(o);
            break;
        case SCALE:
            scale(o);
            break;
        case FITS:
            well = fits(o);
            break;
        case FINITE:
            well = values_are_finite(o);
            break;
        case KEEP_BYTES:
        case KEEP_TEXTS:
            well = keep(o);
            break;
        case START_CLOCK:
            plan->clock = cpu_clock();
            break;
        case CHARGE:
            charge(plan, o);
            break;
        }
        if (heartbeat[TAKEN])
            return ABANDONED;
        if (status == WARNING)
            count_warning(plan, o - all);
        if ((unsigned)status > WARNING || !well) {
            plan->stopped_at = o - all;
            plan->status = status;
            outcome = STOPPED;
            break;
        }
    }
    heartbeat[DOING] = -1;
    return outcome;
}
