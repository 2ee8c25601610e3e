/* Memory that an instance shares with its Python process: a file without a name, or one deleted with its last user. */
#ifndef SHARED_MEMORY_H
#define SHARED_MEMORY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "text.h"

typedef struct {
    intptr_t file; /* a descriptor or a handle, not inherited unless it is passed on; -1: none */
    void *address; /* NULL until it is mapped */
    size_t size;
} SharedMemory;

#define NO_SHARED_MEMORY ((SharedMemory){.file = -1})

/* Makes an empty file; on failure adds why to `fault`. */
bool shared_memory_open(SharedMemory *memory, Text *fault);

/* Maps the file once the other process has given it its size; a second time only if that is still the same. */
bool shared_memory_map(SharedMemory *memory, size_t size, Text *fault);
void shared_memory_close(SharedMemory *memory);

#endif
