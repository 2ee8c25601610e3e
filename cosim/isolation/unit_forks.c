/* What a unit forks is a copy of its process, which returns from the unit's call as the process itself does: it sees the
 * memory that the master shares as it was when it was forked, in a copy of its own, and ends with the call.
 *
 * Without that its late results would be taken for those of the calls that follow. */
#define _GNU_SOURCE
#include "unit_process.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

static char *base;
static size_t region_size;
static volatile bool copied;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER; /* one thread forks at a time */
static struct {
    char *bytes;
    uint64_t used[2][2]; /* begin and end of what is in use: the calls, the heap */
} kept;

static void keep_memory(void) {
    pthread_mutex_lock(&lock);
    const Shared *shared = (Shared *)base;
    uint64_t calls = BATCH_AT + shared->batch_used, heap = region_size / 2, heap_end = shared->heap_used;
    if (calls > heap)
        calls = heap;
    if (heap_end < heap || heap_end > region_size)
        heap_end = heap;
    kept.used[0][1] = calls;
    kept.used[1][0] = heap;
    kept.used[1][1] = heap_end;
    kept.bytes = malloc(calls + heap_end - heap);
    if (!kept.bytes)
        return;
    memcpy(kept.bytes, base, calls);
    memcpy(kept.bytes + calls, base + heap, heap_end - heap);
}

static void forget_memory(void) {
    free(kept.bytes);
    kept.bytes = NULL;
    pthread_mutex_unlock(&lock);
}

static void use_kept_memory(void) {
    int flags = MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED | MAP_NORESERVE;
    copied = true;
    if (!kept.bytes || mmap(base, region_size, PROT_READ | PROT_WRITE, flags, -1, 0) == MAP_FAILED)
        _exit(71);
    const char *bytes = kept.bytes;
    for (int i = 0; i < 2; i++) {
        uint64_t size = kept.used[i][1] - kept.used[i][0];
        memcpy(base + kept.used[i][0], bytes, size);
        bytes += size;
    }
    forget_memory();
}

void separate_forks(void *memory, size_t size) {
    base = memory;
    region_size = size;
    pthread_atfork(keep_memory, forget_memory, use_kept_memory);
}

bool is_forked_copy(void) { return copied; }
