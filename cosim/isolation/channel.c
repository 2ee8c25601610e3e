/* Waits for the other side: for a moment by looking again and again, then asleep. */
#define _GNU_SOURCE
#include "channel.h"

#include <sched.h>
#include <time.h>
#include <unistd.h>

#ifdef __linux__
#include <linux/futex.h>
#include <sys/syscall.h>

static void wake(const Channel *channel) {
    syscall(SYS_futex, (uint32_t *)&channel->shared->turn, FUTEX_WAKE, 1, NULL, NULL, 0);
}

static void sleep_until(const Channel *channel, int milliseconds) {
    struct timespec most = {milliseconds / 1000, milliseconds % 1000 * 1000000L};
    syscall(SYS_futex, (uint32_t *)&channel->shared->turn, FUTEX_WAIT, (uint32_t)!channel->side, &most, NULL, 0);
}
#else
#include <poll.h>

static void wake(const Channel *channel) {
    if (write(channel->socket, "", 1) != 1) {
        /* the other side looks by itself after its time */
    }
}

static void sleep_until(const Channel *channel, int milliseconds) {
    struct pollfd socket = {.fd = channel->socket, .events = POLLIN};
    char bytes[64];
    if (poll(&socket, 1, milliseconds) > 0 && read(channel->socket, bytes, sizeof bytes) <= 0)
        usleep(1000); /* the other side is gone */
}
#endif

enum { ALONE = 2 }; /* microseconds after which other processes may take the processor, such as the one waited for */

static double microseconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return 1e6 * (double)now.tv_sec + 1e-3 * (double)now.tv_nsec;
}

static void pause_briefly(void) {
#if defined(__x86_64__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    __asm__ volatile("yield");
#endif
}

static bool has_come(const Channel *channel) {
    return atomic_load_explicit(&channel->shared->turn, memory_order_acquire) == (uint32_t)channel->side;
}

void channel_give(const Channel *channel) {
    Shared *shared = channel->shared;
    atomic_store(&shared->turn, (uint32_t)!channel->side);
    if (atomic_load(&shared->asleep[!channel->side]))
        wake(channel);
}

bool channel_wait(const Channel *channel, int milliseconds) {
    Shared *shared = channel->shared;
    double begun = microseconds(), spent = 0;
    for (; spent < shared->spin; spent = microseconds() - begun) {
        for (int i = 0; i < 16; i++) {
            if (has_come(channel))
                return true;
            pause_briefly();
        }
        if (spent > ALONE)
            sched_yield();
    }
    atomic_store(&shared->asleep[channel->side], 1u);
    if (!has_come(channel))
        sleep_until(channel, milliseconds);
    atomic_store(&shared->asleep[channel->side], 0u);
    return has_come(channel);
}
