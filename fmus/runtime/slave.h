/* Calls into Python, wherever it runs (side.h). Those that change the block (call, step, set_state) put the instance
 * into the mode FAILED if they fail other than by rejecting the call; all do if the interpreter is gone. */
#ifndef SLAVE_H
#define SLAVE_H

#include "instance.h"

bool slave_start(Instance *instance, const char *function, const char *resources, const char *token);
void slave_release(Instance *instance);
bool slave_revive(Instance *instance, const char *function); /* so that a call can be made, if there is a way */
Status slave_call(Instance *instance, const char *function, const char *method);
Status slave_step(Instance *instance, const char *function);
Status slave_get_state(Instance *instance, const char *function, char **bytes, size_t *size);
Status slave_set_state(Instance *instance, const char *function, const char *bytes, size_t size);
/* The real outputs' derivative in a direction of the real inputs, both as they lie in `floats`. */
Status slave_derivative(Instance *instance, const char *function, const double seed[], double sensitivity[]);
Status slave_get_string(Instance *instance, const char *function, size_t index, const char **value);
Status slave_set_string(Instance *instance, const char *function, size_t index, const char *value);

#endif
