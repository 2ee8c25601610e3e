/* Saved states: what the host gets, sets, frees, serialises. */
#ifndef STATE_H
#define STATE_H

#include "instance.h"

/* A state belongs to the instance that it was got from or deserialised by, until it is freed or the instance is. */
Status state_get(Instance *instance, const char *function, void **state);
Status state_set(Instance *instance, const char *function, void *state);
Status state_free(Instance *instance, const char *function, void **state);
Status state_size(Instance *instance, const char *function, void *state, size_t *size);
Status state_serialise(Instance *instance, const char *function, void *state, void *bytes, size_t size);
Status state_deserialise(Instance *instance, const char *function, const void *bytes, size_t size, void **state);
void states_free(Instance *instance);

#endif
