/* Ticks of a sampled block. */
#ifndef SAMPLING_H
#define SAMPLING_H

#include "instance.h"

static inline bool is_sampled(const Instance *instance) { return instance->period_counter != 0; }
static inline bool has_clock(const Instance *instance) { return instance->abilities & HAS_CLOCK; }
double period(const Instance *instance); /* s */

/* The ticks within a step or, where the host activates the clock, the time until the next. */
Status sampling_step(Instance *instance, const char *function, double t, double dt, StepEnd *end);

/* A tick in event mode: the host activates the clock, may read outputs, which are computed without the tick being
 * done, and settles it. */
Status sampling_activate(Instance *instance, const char *function);
Status sampling_evaluate(Instance *instance, const char *function);
Status sampling_settle(Instance *instance, const char *function);

#endif
