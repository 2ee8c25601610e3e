/* One process for all instances that a host makes of a unit that brings its interpreter: what that takes of memory does
 * not multiply. Each instance has a channel and a memory of its own, which are handed over by the control channel.
 */
#ifndef _WIN32
#define _GNU_SOURCE
#include <errno.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "process_posix.h"

#ifdef __APPLE__
#define CHANGED st_ctimespec
#else
#define CHANGED st_ctim
#endif

struct SharedProcess {
    char *unit; /* see identity() */
    pid_t id, host;
    int control;
    size_t instances, leaving;          /* `leaving`: calls of process_leave() under way */
    bool takes_none;                    /* it has closed the control channel, as it is about to end */
    bool is_over, is_ended, has_status; /* is to end, its end has been awaited, `status` is how it ended */
    bool was_silent;                    /* it was ended as an instance got no answer */
    int status;
    SharedProcess *next;
};

static SharedProcess *all;
static atomic_int holder; /* the process that has the lock, or 0: a host may make instances in several threads */

static void pause_briefly(void) { nanosleep(&(struct timespec){.tv_nsec = 100000}, NULL); }

/* Where a host forks while one of its threads has the lock, its child has no thread that would give it back: the child
 * takes it over. It finds a sound list, as each change of that is a single write. */
static void lock(void) {
    int own = (int)getpid();
    for (;;) {
        int found = 0;
        if (atomic_compare_exchange_strong(&holder, &found, own)) return;
        if (found != own && atomic_compare_exchange_strong(&holder, &found, own)) return;
        pause_briefly();
    }
}

static void unlock(void) { atomic_store(&holder, 0); }

/* What instances of one unit have in common. Another unit that is unpacked to the same place has another token, or, of the
 * same sources with other packages, a program that was changed at another time. */
static char *identity(const char *program, const char *token) {
    Text text = {0};
    struct stat facts = {0};
    stat(program, &facts);
    text_add(&text, "%s\n%s\n%llu %llu %lld.%09ld", program, token, (unsigned long long)facts.st_dev,
             (unsigned long long)facts.st_ino, (long long)facts.CHANGED.tv_sec, (long)facts.CHANGED.tv_nsec);
    char *copy = copy_of(text_of(&text));
    text_clear(&text);
    return copy;
}

/* One that runs; those of a host that forked this one are that host's. */
static SharedProcess *find(const char *unit) {
    for (SharedProcess *one = all; one; one = one->next)
        if (one->host == getpid() && !one->is_over && !one->takes_none && strcmp(one->unit, unit) == 0 &&
            process_life(one->id) == RUNS)
            return one;
    return NULL;
}

/* Takes `unit` over. */
static SharedProcess *begin(char *unit, const char *program, const char *const arguments[], Text *fault) {
    SharedProcess *one = calloc(1, sizeof *one);
    if (one && process_start_alone(program, arguments, &one->id, &one->control, fault)) {
        one->unit = unit;
        one->host = getpid();
        one->next = all;
        return all = one;
    }
    free(unit);
    free(one);
    return NULL;
}

static bool hand_over(int control, int channel, int memory) {
    char byte = 0, room[CMSG_SPACE(2 * sizeof(int))] = {0};
    struct iovec content = {.iov_base = &byte, .iov_len = 1};
    struct msghdr message = {.msg_iov = &content, .msg_iovlen = 1, .msg_control = room, .msg_controllen = sizeof room};
    struct cmsghdr *head = CMSG_FIRSTHDR(&message);
    head->cmsg_level = SOL_SOCKET;
    head->cmsg_type = SCM_RIGHTS;
    head->cmsg_len = CMSG_LEN(2 * sizeof(int));
    memcpy(CMSG_DATA(head), (int[]){channel, memory}, 2 * sizeof(int));
    ssize_t sent;
    do {
#ifdef MSG_NOSIGNAL
        sent = sendmsg(control, &message, MSG_NOSIGNAL);
#else
        sent = sendmsg(control, &message, 0);
#endif
    } while (sent < 0 && errno == EINTR);
    return sent == 1;
}

/* Takes a process that has ended, and that nobody has to do with any more, off the list and frees its entry. */
static void drop(SharedProcess *one) {
    for (SharedProcess **place = &all; *place; place = &(*place)->next)
        if (*place == one) {
            *place = one->next;
            break;
        }
    free(one->unit);
    free(one);
}

/* Closes the control channel, at which a process ends that has no instances. */
static void begin_end(SharedProcess *one) {
    one->is_over = true;
    shutdown(one->control, SHUT_RDWR);
    close(one->control);
}

Process *process_join(const char *program, const char *token, const char *const arguments[], const SharedMemory *memory,
                      Text *fault) {
    int ends[2] = {-1, -1};
    Process *process = calloc(1, sizeof *process);
    if (!process || !process_open_channel(ends)) {
        text_add(fault, "no channel to it: %s", strerror(errno));
        free(process);
        return NULL;
    }
    char *unit = identity(program, token);
    lock();
    SharedProcess *shared = unit ? find(unit) : NULL;
    bool joined = shared && hand_over(shared->control, ends[1], (int)memory->file);
    if (shared && !joined && (errno == EPIPE || errno == ECONNRESET)) { /* it crashes: its instances will note that */
        shared->takes_none = true;
        shared = NULL;
    }
    if (!shared && unit) {
        shared = begin(unit, program, arguments, fault);
        unit = NULL;
        joined = shared && hand_over(shared->control, ends[1], (int)memory->file);
    }
    if (shared && !joined) text_add(fault, "it takes no instance: %s", strerror(errno));
    free(unit);
    if (joined) {
        shared->instances++;
        *process = (Process){.id = shared->id, .host = getpid(), .channel = ends[0], .shared = shared};
    } else if (shared && shared->instances == 0) {
        int status;
        begin_end(shared);
        process_reap(shared->id, 0.0, &status);
        drop(shared);
    }
    unlock();
    close(ends[1]);
    if (joined) return process;
    close(ends[0]);
    free(process);
    return NULL;
}

/* The end is awaited without the lock, so that instances of other units can be made meanwhile. */
bool process_leave(SharedProcess *shared, double patience, int *status, bool *was_silent) {
    lock();
    shared->leaving++;
    bool is_last = --shared->instances == 0;
    if (!shared->is_over) {
        bool runs = process_life(shared->id) == RUNS;
        if (runs && patience == 0.0) shared->was_silent = true;
        if (is_last || patience == 0.0 || !runs) {
            begin_end(shared);
            unlock();
            int how = 0;
            bool reaped = process_reap(shared->id, patience, &how);
            lock();
            shared->has_status = reaped;
            shared->status = how;
            shared->is_ended = true;
        }
    }
    while (shared->is_over && !shared->is_ended) { /* another thread awaits it */
        unlock();
        pause_briefly();
        lock();
    }
    bool over = shared->has_status;
    *status = shared->status;
    *was_silent = shared->was_silent;
    if (--shared->leaving == 0 && shared->instances == 0) drop(shared);
    unlock();
    return over;
}

#endif
