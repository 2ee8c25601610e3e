#ifndef UNIT_PROCESS_H
#define UNIT_PROCESS_H

#include "calls.h"
#include "channel.h"

typedef void (*Function)(void);

typedef struct {
    const char *name;
    enum shape shape;
    Function function;
} Entry;

extern Entry entries[N_CALLS];

int load_library(const char *path, const char *prefix);
void unload_library(void);
void add_log(int status, const char *message);
void separate_forks(void *memory, size_t size);
bool is_forked_copy(void);
_Noreturn void serve(const Channel *channel, size_t size);

#endif
