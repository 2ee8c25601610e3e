/* Steps, and event mode between them. */
#ifndef STEPPING_H
#define STEPPING_H

#include "instance.h"

static inline bool has_events(const Instance *instance) { return instance->abilities & HAS_EVENTS; }

/* A step from `t` on, which must be the instance's time but for rounding errors of a host that adds up step sizes. */
Status instance_step(Instance *instance, const char *function, double t, double dt, StepEnd *end);

/* Into event mode and out of it; to leave, what is due has to be settled. */
Status events_enter(Instance *instance, const char *function);
Status events_leave(Instance *instance, const char *function);
/* Settles what is due at this instant; gives the time of the next known event, or infinity. */
Status events_update(Instance *instance, const char *function, double *next_event);

#endif
