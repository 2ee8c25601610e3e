/* An instance's modes from instantiation to its end. */
#ifndef LIFECYCLE_H
#define LIFECYCLE_H

#include "instance.h"

/* NULL if there is no memory. `log` hands a message to `host_logger` by the standard's own callback. */
Instance *instance_new(const char *name, Logger *log, void (*host_logger)(void), void *environment, bool logging);
void instance_free(Instance *instance);
Status instance_set_times(Instance *instance, const char *function, double start, bool has_stop, double stop);
Status instance_enter_initialisation(Instance *instance, const char *function);
Status instance_exit_initialisation(Instance *instance, const char *function);
Status instance_terminate(Instance *instance, const char *function);
Status instance_reset(Instance *instance, const char *function);

/* Brings the outputs up to date where they follow what is set without a step: in initialisation mode, and at an active
 * clock's tick. */
Status instance_refresh_outputs(Instance *instance, const char *function);

#endif
