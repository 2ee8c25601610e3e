/* Makes the calls of a batch, one after another, until one fails. */
#define _GNU_SOURCE
#include "unit_process.h"

#include <fcntl.h>
#include <fenv.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

typedef uint64_t W;
typedef int (*Integers)(void *, W, W, W, W, W, W, W, W, W, W);
typedef void (*Logger2)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger2 logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks2;

static Channel channel;
static Shared *shared;
static size_t region_size;
static char *base;
static void *component;
static pthread_t serving;
static fenv_t arithmetic;
static const char *maps[MAX_MAPS];

static void *address(uint64_t offset) { return offset ? base + offset : NULL; }

/* Lines of the serving thread go to the shared memory at once, those of others when it comes by. */
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static char others[LOG_SIZE];
static uint32_t others_used;

static uint32_t put_line(char *log, uint32_t used, int status, const char *message, size_t length) {
    size_t most = LOG_SIZE / 4;
    LogLine line = {status, (uint32_t)((length < most ? length : most) + 1)};
    size_t size = aligned(sizeof line + line.length);
    if (used + size > LOG_SIZE)
        return 0;
    memcpy(log + used, &line, sizeof line);
    memcpy(log + used + sizeof line, message, line.length - 1);
    log[used + sizeof line + line.length - 1] = 0;
    return used + (uint32_t)size;
}

static void give_and_wait(void) {
    channel_give(&channel);
    while (!channel_wait(&channel, 1000))
        ;
}

void add_log(int status, const char *message) {
    size_t length = message ? strlen(message) : 0;
    if (is_forked_copy())
        return; /* nobody reads its log */
    if (!message)
        message = "";
    if (pthread_equal(pthread_self(), serving)) {
        uint32_t used = put_line(shared->log, shared->log_used, status, message, length);
        if (!used) {
            shared->log_is_full = 1;
            give_and_wait();
            used = put_line(shared->log, shared->log_used, status, message, length);
        }
        shared->log_used = used ? used : shared->log_used;
        return;
    }
    pthread_mutex_lock(&lock);
    uint32_t used = put_line(others, others_used, status, message, length);
    others_used = used ? used : others_used; /* where there is no room, the line is lost */
    pthread_mutex_unlock(&lock);
}

static void add_lines_of_others(void) {
    pthread_mutex_lock(&lock);
    for (uint32_t at = 0; at < others_used;) {
        LogLine line;
        memcpy(&line, others + at, sizeof line);
        add_log(line.status, others + at + sizeof line);
        at += (uint32_t)aligned(sizeof line + line.length);
    }
    others_used = 0;
    pthread_mutex_unlock(&lock);
}

static void log_2(void *environment, const char *name, int status, const char *category, const char *format, ...) {
    va_list values, again;
    va_start(values, format);
    va_copy(again, values);
    int length = vsnprintf(NULL, 0, format ? format : "", values);
    char *message = malloc((size_t)(length > 0 ? length : 0) + 1);
    if (message) {
        *message = 0;
        vsnprintf(message, (size_t)(length > 0 ? length : 0) + 1, format ? format : "", again);
        add_log(status, message);
    }
    free(message);
    va_end(again);
    va_end(values);
}

static void log_3(void *environment, int status, const char *category, const char *message) {
    add_log(status, message);
}

static const Callbacks2 callbacks = {log_2, calloc, free, NULL, NULL};

static int integers(const Entry *entry, const W *a) {
    return ((Integers)entry->function)(component, a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9]);
}

static int instantiate_2(const Entry *entry, const W *a) {
    typedef void *(*Instantiate)(const char *, int, const char *, const char *, const Callbacks2 *, int, int);
    component = ((Instantiate)entry->function)((char *)a[0], (int)a[1], (char *)a[2], (char *)a[3], &callbacks,
                                               (int)a[4], (int)a[5]);
    return component ? OK : ERROR;
}

static int instantiate_3(const Entry *entry, const W *a) {
    typedef void *(*Instantiate)(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *,
                                 size_t, void *, void (*)(void *, int, const char *, const char *), void *);
    component = ((Instantiate)entry->function)((char *)a[0], (char *)a[1], (char *)a[2], a[3], a[4], a[5], a[6],
                                               (uint32_t *)a[7], (size_t)a[8], NULL, log_3, NULL);
    return component ? OK : ERROR;
}

static int free_instance(const Entry *entry) {
    ((void (*)(void *))entry->function)(component);
    return OK;
}

static int setup(const Entry *entry, const W *a, const double *reals) {
    if (entry->shape == SETUP_2)
        return ((int (*)(void *, int, double, double, int, double))entry->function)(component, (int)a[0], reals[0],
                                                                                    reals[1], (int)a[1], reals[2]);
    return ((int (*)(void *, bool, double, double, bool, double))entry->function)(component, a[0], reals[0], reals[1],
                                                                                  a[1], reals[2]);
}

static int step_2(const Entry *entry, const W *a, const double *reals, bool *plain) {
    int status = ((int (*)(void *, double, double, int))entry->function)(component, reals[0], reals[1], (int)a[0]);
    *plain = succeeded(status);
    return status;
}

static int step_3(const Entry *entry, const W *a, const double *reals, bool *plain) {
    typedef int (*Step)(void *, double, double, bool, bool *, bool *, bool *, double *);
    bool *flags[] = {(bool *)a[1], (bool *)a[2], (bool *)a[3]};
    int status = ((Step)entry->function)(component, reals[0], reals[1], a[0], flags[0], flags[1], flags[2],
                                         (double *)a[4]);
    *plain = succeeded(status) && !*flags[0] && !*flags[1] && !*flags[2];
    return status;
}

/* Map the memory of another instance, whose texts and binaries the unit is to read without a copy. */
static int map(const W *a) {
    int file = open((char *)a[1], O_RDONLY | O_CLOEXEC);
    if (file < 0)
        return DISCARD;
    void *memory = mmap(NULL, (size_t)a[2], PROT_READ, MAP_SHARED | MAP_NORESERVE, file, 0);
    close(file);
    if (memory == MAP_FAILED)
        return DISCARD;
    maps[a[0]] = memory;
    return OK;
}

static void fill_table(const Record *record) {
    uint64_t *table = address(record->table);
    for (uint64_t i = 0; i < record->n_table; i++) {
        uint64_t offset = table[i];
        if (offset >> 63)
            table[i] = (uint64_t)(maps[offset >> 48 & (MAX_MAPS - 1)] + (offset & (((uint64_t)1 << 48) - 1)));
        else
            table[i] = (uint64_t)address(offset);
    }
}

static bool keep(Slot *slot, Place *place, const void *given, size_t size) {
    uint32_t which = !slot->held;
    if (!given && size) { /* a NULL that has a size: passed on, for the master to refuse */
        place->at[which] = place->room[which] = 0;
        place->size[which] = size;
        return true;
    }
    if (place->room[which] < size || !place->at[which]) {
        uint64_t room = size + size / 2 + 16, at = heap_take(shared, region_size, room);
        if (!at)
            return false;
        place->at[which] = at;
        place->room[which] = room;
    }
    if (size)
        memcpy(address(place->at[which]), given, size);
    place->size[which] = size;
    return true;
}

static int get_texts(const Entry *entry, Slot *slot, bool binary) {
    const void **given = calloc(slot->n_values ? slot->n_values : 1, sizeof *given);
    size_t *sizes = calloc(slot->n_values ? slot->n_values : 1, sizeof *sizes);
    Place *places = address(slot->values);
    void *references = address(slot->references);
    int status = FATAL;
    if (given && sizes && binary)
        status = integers(entry, (W[10]){(W)references, slot->n, (W)sizes, (W)given, slot->n_values});
    else if (given && sizes)
        status = integers(entry, (W[10]){(W)references, slot->n, (W)given, slot->n_values});
    for (uint64_t i = 0; status <= WARNING && i < slot->n_values; i++) {
        const char *value = binary || given[i] ? given[i] : "";
        if (!keep(slot, &places[i], value, binary ? sizes[i] : strlen(value) + 1)) {
            add_log(ERROR, "the memory shared with the master has no room for its texts and binaries");
            status = ERROR;
        }
    }
    free(given);
    free(sizes);
    return status;
}

static int read_slot(Slot *slot) {
    const Entry *entry = &entries[slot->call];
    atomic_store(&shared->doing, slot->call);
    if (entry->shape == INTEGERS)
        slot->status = integers(entry, (W[10]){(W)address(slot->references), slot->n, (W)address(slot->values),
                                               slot->n_values});
    else
        slot->status = get_texts(entry, slot, entry->shape == GET_BINARIES);
    slot->written = !slot->held;
    slot->done = 1;
    return slot->status;
}

/* Make a call; `plain` is whether the last step went on as asked. */
static int make_call(const Record *record, bool *plain) {
    const Entry *entry = &entries[record->call];
    W a[MAX_ARGUMENTS];
    for (int i = 0; i < MAX_ARGUMENTS; i++)
        a[i] = record->addresses >> i & 1 ? (W)address(record->arguments[i]) : record->arguments[i];
    if (record->table)
        fill_table(record);
    switch (entry->shape) {
    case INTEGERS:
        return integers(entry, a);
    case FREE:
        return free_instance(entry);
    case INSTANTIATE_2:
        return instantiate_2(entry, a);
    case INSTANTIATE_3:
        return instantiate_3(entry, a);
    case SETUP_2:
    case SETUP_3:
        return setup(entry, a, record->reals);
    case STEP_2:
        return step_2(entry, a, record->reals, plain);
    case STEP_3:
        return step_3(entry, a, record->reals, plain);
    case LOAD:
        return load_library((char *)a[0], (char *)a[1]);
    case UNLOAD:
        unload_library();
        return OK;
    case MAP:
        return map(a);
    case GET_SLOT:
        return read_slot((Slot *)a[0]);
    default:
        return ERROR;
    }
}

/* Return whether a step was among the calls. */
static bool make_calls(bool *ended) {
    bool plain = true, stepped = false;
    for (uint64_t at = BATCH_AT, end = BATCH_AT + shared->batch_used; at < end;) {
        Record *record = address(at);
        if (record->after_step && !plain)
            break;
        uint64_t size = record->size;
        shared->stopped_at = record->after_step ? shared->stopped_at : at;
        atomic_store(&shared->doing, record->call);
        int status = make_call(record, &plain);
        if (is_forked_copy())
            _exit(0);
        record->status = status;
        if (status == WARNING)
            shared->warned = 1;
        enum shape shape = entries[record->call].shape;
        *ended = shape == UNLOAD;
        stepped |= shape == STEP_2 || shape == STEP_3;
        if (!succeeded(status) && !record->after_step)
            break;
        at += size;
    }
    atomic_store(&shared->doing, -1);
    return stepped;
}

static double cpu_seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

_Noreturn void serve(const Channel *with, size_t size) {
    channel = *with;
    shared = channel.shared;
    base = (char *)shared;
    region_size = size;
    serving = pthread_self();
    separate_forks(base, size);
    fegetenv(&arithmetic);
    for (bool ended = false;;) {
        while (!channel_wait(&channel, 1000))
            ;
        double began = shared->measures_cpu ? cpu_seconds() : 0;
        bool stepped = make_calls(&ended);
        fesetenv(&arithmetic); /* as the master puts back what a unit in its own process changes */
        if (shared->measures_cpu && stepped)
            shared->cpu += cpu_seconds() - began;
        add_lines_of_others();
        channel_give(&channel);
        if (ended)
            _exit(0);
    }
}
