/* A connection to the process of a unit: how it begins, waiting for it, and how it ends. */
#define _GNU_SOURCE
#include "proxy.h"

#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { POLL = 20 }; /* milliseconds after which it is looked whether the process lives */

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static Connection *connections;
static _Thread_local Connection *next_instance;

static const char *const names[] = {
#define AS_NAME(name, shape) #name,
    CALLS(AS_NAME)};

/* Map `size` bytes of a file. `number` is one that no other connection of this process has. */
API Connection *isolation_open(int file, uint64_t size, int number, uint32_t spin, int socket) {
    void *memory = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_NORESERVE, file, 0);
    if (memory == MAP_FAILED)
        return NULL;
    Connection *c = calloc(1, sizeof *c);
    *c = (Connection){
        .channel = {memory, MASTER, socket}, .base = memory, .size = size, .file = file, .number = number};
    c->failed = -1;
    Shared *shared = memory;
    shared->spin = spin;
    shared->doing = -1;
    shared->heap_used = size / 2;
    pthread_mutex_lock(&lock);
    c->next = connections;
    connections = c;
    pthread_mutex_unlock(&lock);
    return c;
}

API void isolation_started(Connection *c, long process, double limit, const double *time) {
    c->process = process;
    c->limit = limit;
    c->time = time;
}

/* The next instance that this thread makes is the one of this connection. */
API void isolation_select(Connection *c) { next_instance = c; }

Connection *take_next(void) {
    Connection *c = next_instance;
    next_instance = NULL;
    return c;
}

/* What was read until now is gone with this. */
API void isolation_close(Connection *c) {
    pthread_mutex_lock(&lock);
    for (Connection **p = &connections; *p; p = &(*p)->next)
        if (*p == c) {
            *p = c->next;
            break;
        }
    pthread_mutex_unlock(&lock);
    munmap(c->base, c->size);
    for (size_t i = 0; i < c->n_known; i++)
        free(c->known[i].references);
    free(c->known);
    free(c->name);
    free(c);
}

/* How the process ended, with which signal or status, and in which call. */
API int isolation_ending(const Connection *c, int *ended_with) {
    *ended_with = c->ending == BY_SIGNAL || c->ending == BY_EXIT ? c->ended_with : 0;
    return c->ending;
}

/* The call in which the last failure arose, where it is not the one that reported it; "" otherwise. */
API const char *isolation_failed_call(const Connection *c) { return c->failed < 0 ? "" : names[c->failed]; }

/* Return a call that answered Warning after it had returned OK, with the time of the first and how many there were, and
 * forget it; NULL if there is none left. */
API const char *isolation_take_warnings(Connection *c, double *first, uint64_t *n) {
    for (int i = 0; i < N_CALLS; i++)
        if (c->warned[i].n) {
            *first = c->warned[i].first;
            *n = c->warned[i].n;
            c->warned[i].n = 0;
            return names[i];
        }
    return NULL;
}

/* Let the process measure the CPU time of its steps; return where it adds it up, for the master to take away. */
API double *isolation_measure_cpu(Connection *c) {
    c->channel.shared->measures_cpu = 1;
    return &c->channel.shared->cpu;
}

API bool isolation_is_stepping(const Connection *c) { return c->in_flight; }

static bool has_ended(Connection *c, int options) {
    siginfo_t info;
    memset(&info, 0, sizeof info);
    int status = waitid(P_PID, (id_t)c->process, &info, WEXITED | WNOWAIT | options);
    if (status == 0 && info.si_pid == 0)
        return false;
    if (c->ending == RUNNING) {
        c->ending = status ? UNKNOWN : info.si_code == CLD_EXITED ? BY_EXIT : BY_SIGNAL;
        c->ended_with = info.si_status;
    }
    return true;
}

void end_process(Connection *c, enum ending why) {
    if (c->ending == RUNNING)
        c->ending = why;
    kill((pid_t)c->process, SIGKILL);
    has_ended(c, 0);
}

/* The process has ended in order, or is about to be ended: no call follows. */
API void isolation_over(Connection *c) { c->ending = c->ending == RUNNING ? BY_MASTER : c->ending; }

static void pass_log_on(Connection *c) {
    Shared *shared = c->channel.shared;
    uint32_t used = shared->log_used <= LOG_SIZE ? shared->log_used : LOG_SIZE;
    for (uint32_t at = 0; at + sizeof(LogLine) < used;) {
        LogLine line;
        memcpy(&line, shared->log + at, sizeof line);
        at += sizeof line;
        if (!line.length || line.length > LOG_SIZE - at)
            break;
        char *text = shared->log + at;
        text[line.length - 1] = 0;
        if (c->logger_2)
            c->logger_2(c->environment, c->name ? c->name : "", line.status, "unit", "%s", text);
        else if (c->logger_3)
            c->logger_3(c->environment, line.status, "unit", text);
        at += (uint32_t)(aligned(sizeof line + line.length) - sizeof line);
    }
    shared->log_used = 0;
}

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Wait until the process has made the calls of the batch; return whether it has. Of the time between two looks only a
 * part counts: if more has passed, the machine was asleep, or this process was stopped. */
bool await(Connection *c) {
    Shared *shared = c->channel.shared;
    double spent = 0, looked = 0;
    for (;;) {
        if (channel_wait(&c->channel, POLL)) {
            pass_log_on(c);
            if (!shared->log_is_full)
                return true;
            shared->log_is_full = 0;
            channel_give(&c->channel);
            continue;
        }
        if (has_ended(c, WNOHANG)) {
            if (channel_wait(&c->channel, 0) && !shared->log_is_full)
                continue; /* it had answered before */
            break;
        }
        double now = seconds(), passed = looked ? now - looked : POLL * 1e-3;
        looked = now;
        spent += passed < 0.5 ? passed : 0.5;
        if (c->limit && spent > c->limit) {
            end_process(c, BY_LIMIT);
            break;
        }
    }
    int doing = atomic_load(&shared->doing);
    c->failed = doing >= 0 && doing < N_CALLS ? doing : -1;
    pass_log_on(c);
    return false;
}

/* Return the connection in whose memory an address lies, or NULL. */
Connection *owner(const void *address) {
    pthread_mutex_lock(&lock);
    Connection *c = connections;
    while (c && !((const char *)address >= c->base && (const char *)address < c->base + c->size))
        c = c->next;
    pthread_mutex_unlock(&lock);
    return c;
}
