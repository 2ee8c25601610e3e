/* What an instance knows of its variables, and checks of their values. */
#ifndef VARIABLES_H
#define VARIABLES_H

#include "instance.h"

/* Takes over the table that describes the buffers. The addresses in it are off by `shift`, where another process wrote
 * them, which has mapped the memory that both share to another place. */
bool take_table(Instance *instance, const char *bytes, size_t size, uint64_t shift);

/* The variable of a checked value reference. */
static inline const Variable *variable_of(const Instance *instance, uint32_t reference) {
    return &instance->variables[reference];
}

static inline const char *name_of(const Instance *instance, const Variable *variable) {
    return instance->names + variable->name;
}

/* Whether all real inputs are finite; if not, says so in the log. */
bool inputs_finite(const Instance *instance, const char *function);
/* Whether all real outputs are, and those of type Float32 within its range. If not, the block has got there by itself,
 * so it is of no further use: the mode is FAILED. */
Status check_outputs(Instance *instance, const char *function);

#endif
