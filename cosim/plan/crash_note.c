/* Notes in shared memory, as this process crashes, which thread crashed and where, for the process that survives. */
#ifndef _WIN32
#define _GNU_SOURCE
#include <signal.h>
#include <stddef.h>
#include <stdint.h>
#include <unistd.h>
#ifdef __linux__
#include <sys/syscall.h>
#include <ucontext.h>
#else /* macOS's <ucontext.h> is refused without _XOPEN_SOURCE, which hides pthread_threadid_np() */
#include <pthread.h>
#include <sys/ucontext.h>
#endif

static volatile int64_t *note;

static int64_t thread_number(void) {
#ifdef __linux__
    return syscall(SYS_gettid);
#else
    uint64_t number = 0;
    pthread_threadid_np(NULL, &number);
    return (int64_t)number;
#endif
}

static int64_t instruction(const void *context) {
    const ucontext_t *c = context;
#if defined(__linux__) && defined(__x86_64__)
    return c->uc_mcontext.gregs[REG_RIP];
#elif defined(__linux__) && defined(__aarch64__)
    return (int64_t)c->uc_mcontext.pc;
#elif defined(__APPLE__) && defined(__x86_64__)
    return (int64_t)c->uc_mcontext->__ss.__rip;
#elif defined(__APPLE__) && defined(__aarch64__)
    return (int64_t)c->uc_mcontext->__ss.__pc;
#else
    return 0;
#endif
}

static void take_note(int number, siginfo_t *info, void *context) {
    if (!note[0]) {
        note[1] = instruction(context);
        note[0] = thread_number();
    }
    signal(number, SIG_DFL); /* the process ends as it would have done, by the same signal */
    raise(number);
}

/* Write to two cells: 0 the number of the thread, 1 the address of its instruction. */
__attribute__((visibility("default"))) void plan_note_crash(int64_t *cells) {
    const int crashes[] = {SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT};
    note = cells;
    for (size_t i = 0; i < sizeof crashes / sizeof *crashes; i++) {
        struct sigaction action = {.sa_flags = SA_SIGINFO | SA_NODEFER | SA_ONSTACK};
        action.sa_sigaction = take_note;
        sigemptyset(&action.sa_mask);
        sigaction(crashes[i], &action, NULL);
    }
}
#else
#include <stdint.h>
__declspec(dllexport) void plan_note_crash(int64_t *cells) {}
#endif
