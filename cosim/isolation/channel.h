/* What a master and the process of one unit share: whose turn it is, the calls to be made, and their results.
 *
 * One region of memory that both map, at different addresses: places in it are offsets from its begin. Only the side
 * whose turn it is reads and writes it, but for `turn` and `asleep`. The master's side believes nothing that it reads
 * there: the unit may have written over it. */
#ifndef CHANNEL_H
#define CHANNEL_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum status { OK, WARNING, DISCARD, ERROR, FATAL };
enum side { MASTER, UNIT };
enum { MAX_ARGUMENTS = 10, MAX_REALS = 3, LOG_SIZE = 1 << 16, BATCH_AT = 1 << 17 };

/* A call, followed by what its arguments point to. The calls that are to be made lie one after another: a batch. */
typedef struct {
    int32_t call, status;
    uint32_t addresses; /* bit i: argument i is an offset, to be passed as an address; 0 is NULL */
    uint32_t after_step;   /* a GET_SLOT that is made only if the step before it went on as asked */
    uint64_t size;      /* of all this */
    uint64_t arguments[MAX_ARGUMENTS];
    double reals[MAX_REALS];
    uint64_t table, n_table; /* offset of a table of offsets that are to be addresses; 0: none */
} Record;

/* Variables that are read together again and again. Numbers lie at `values`; of a text or a binary there are two
 * places, so that the one which the master holds stays while the next is written. */
typedef struct {
    int32_t call, status;
    uint32_t done;      /* whether it was read when it was last asked for */
    uint32_t held, written; /* which of the two places the master holds, and which was written last */
    uint32_t unused;
    uint64_t n, n_values;
    uint64_t references, values;
} Slot;

typedef struct {
    uint64_t at[2], room[2], size[2];
} Place;

/* In a table of addresses: bytes in the memory of another instance, as the unit's process has mapped it. */
#define ELSEWHERE(map, offset) ((uint64_t)1 << 63 | (uint64_t)(map) << 48 | (offset))
enum { MAX_MAPS = 1 << 12 };

typedef struct {
    int32_t status;
    uint32_t length; /* of the text after it, with its end */
} LogLine;

typedef struct {
    _Atomic uint32_t turn, asleep[2];
    uint32_t spin;          /* microseconds that a side waits before it sleeps */
    uint32_t log_is_full;   /* the turn is given only to empty the log */
    uint32_t warned;        /* a call answered Warning, and the master has not looked which */
    _Atomic int32_t doing;  /* the call that the unit's process is in; -1: none */
    uint64_t batch_used;     /* bytes */
    uint64_t stopped_at;    /* offset of the record that was executed last */
    uint64_t heap_used;     /* offset of free memory, behind the batch */
    double cpu;             /* seconds of CPU time of the steps that the master has not taken yet, */
    uint32_t measures_cpu;  /* if it wants them */
    uint32_t log_used;
    char log[LOG_SIZE];
} Shared;

_Static_assert(sizeof(Shared) <= BATCH_AT, "the batch begins after it");

typedef struct {
    Shared *shared;
    enum side side;
    int socket; /* a socket to the other side, where the system has no futex; else -1 */
} Channel;

void channel_give(const Channel *channel);
/* Wait for this side's turn, for so many milliseconds at most; return whether it has come. */
bool channel_wait(const Channel *channel, int milliseconds);

/* Any other status is a failure, also one that the standards do not know, such as -2. */
static inline bool succeeded(int status) { return status == OK || status == WARNING; }

static inline uint64_t aligned(uint64_t size) { return (size + 15) & ~(uint64_t)15; }

/* Memory of the region that is never freed; 0 if there is none left. */
static inline uint64_t heap_take(Shared *shared, uint64_t limit, uint64_t size) {
    uint64_t at = aligned(shared->heap_used);
    if (size > limit || at > limit - size)
        return 0;
    shared->heap_used = at + size;
    return at;
}

#endif
