/* x' = u, y = x, and each does to its process what none should: in the step that goes beyond the time `at`, as it is
 * instantiated, terminated or freed, or as its library is loaded or unloaded: `hang_in_step`, `hang_in_load`, ... */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fenv.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "frame/unit.h"

typedef struct {
    double u, y, at;
} Harmful;

static const Variable variables[] = {
    {"u", INPUT, REAL, offsetof(Harmful, u), .start = 1},
    {"y", OUTPUT, REAL, offsetof(Harmful, y)},
    {"at", PARAMETER, REAL, offsetof(Harmful, at), .unit = "s", .start = 0.25},
};

static void change_directory(void) {
    if (chdir("/"))
        abort();
}
static void close_descriptors(void) {
    for (int i = 3; i < 1024; i++)
        close(i);
}
static void close_output(void) { close(1); }
static void take_output(void) { /* whatever it writes there goes to its own file */
    close(1);
    if (open("/dev/null", O_WRONLY) != 1)
        abort();
}
static void handle(int number) {}
static void install_handlers(void) {
    const int numbers[] = {SIGINT, SIGTERM, SIGHUP, SIGSEGV, SIGCHLD, SIGPIPE};
    for (size_t i = 0; i < COUNT(numbers); i++)
        signal(numbers[i], handle);
}
static void round_up(void) { fesetround(FE_UPWARD); }
static void trap_division(void) {
#ifdef __x86_64__
    unsigned mode;
    __asm__ volatile("stmxcsr %0" : "=m"(mode));
    mode &= ~0x680u; /* invalid, division by zero, overflow */
    __asm__ volatile("ldmxcsr %0" : : "m"(mode));
#endif
}
static void fork_itself(void) {
    if (fork() < 0)
        abort();
}
static void hang(void) {
    for (;;)
        sleep(1);
}
static void crash(void) { raise(SIGSEGV); }
static void *crash_later(void *nothing) {
    usleep(300000);
    volatile int *nowhere = (int *)16;
    *nowhere = 1;
    return nothing;
}
static void start_crashing_thread(void) {
    pthread_t thread;
    if (pthread_create(&thread, NULL, crash_later, NULL))
        abort();
    pthread_detach(thread);
}
static void ignore_signals_and_hang(void) {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_BLOCK, &all, NULL);
    for (int i = 1; i < 32; i++)
        signal(i, SIG_IGN);
    hang();
}
static void fork_and_hang(void) {
    fork();
    hang();
}
static void sleep_in_group(void) {
    if (fork() == 0) {
        sleep(300);
        _exit(0);
    }
}
static void sleep_in_daemon(void) {
    if (fork() != 0)
        return;
    if (setsid() < 0)
        abort();
    if (fork() == 0)
        sleep(300);
    _exit(0);
}
static void stop_itself(void) { raise(SIGSTOP); }
static void limit_files(void) {
    signal(SIGXFSZ, SIG_DFL);
    setrlimit(RLIMIT_FSIZE, &(struct rlimit){10, RLIM_INFINITY});
}
static void limit_descriptors(void) { setrlimit(RLIMIT_NOFILE, &(struct rlimit){0, 4096}); }
static void lower_files(void) { setrlimit(RLIMIT_FSIZE, &(struct rlimit){1000, 1000}); }
static void lower_descriptors(void) { setrlimit(RLIMIT_NOFILE, &(struct rlimit){4, 4}); }
static void lower_memory(void) { setrlimit(RLIMIT_AS, &(struct rlimit){300000000, 300000000}); }

#define HARMS(DO)                                                                                                      \
    DO(change_directory)                                                                                               \
    DO(close_descriptors)                                                                                              \
    DO(close_output)                                                                                                   \
    DO(take_output)                                                                                                    \
    DO(install_handlers)                                                                                               \
    DO(round_up)                                                                                                       \
    DO(trap_division)                                                                                                  \
    DO(fork_itself)                                                                                                    \
    DO(hang)                                                                                                           \
    DO(crash)                                                                                                          \
    DO(start_crashing_thread)                                                                                          \
    DO(ignore_signals_and_hang)                                                                                        \
    DO(fork_and_hang)                                                                                                  \
    DO(sleep_in_group)                                                                                                 \
    DO(sleep_in_daemon)                                                                                                \
    DO(stop_itself)                                                                                                    \
    DO(limit_files)                                                                                                    \
    DO(limit_descriptors)                                                                                              \
    DO(lower_files)                                                                                                    \
    DO(lower_descriptors)                                                                                              \
    DO(lower_memory)

static enum status integrate(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Harmful);
    self->y += h * self->u;
    return OK;
}

#define MODEL(name, ...)                                                                                               \
    static const Model name = {#name, variables, COUNT(variables), 0.1, 0, sizeof(Harmful), __VA_ARGS__};              \
    UNIT(name)

/* once a process, in its first step beyond `at` */
#define IN_EACH_CALL(harm)                                                                                             \
    static enum status step_##harm(Unit *unit, double t, double h, StepEnd *end) {                                     \
        static bool done;                                                                                              \
        SELF(Harmful);                                                                                                 \
        if (!done && t + h > self->at * (1 + 1e-12)) {                                                                 \
            done = true;                                                                                               \
            harm();                                                                                                    \
        }                                                                                                              \
        return integrate(unit, t, h, end);                                                                             \
    }                                                                                                                  \
    static void call_##harm(Unit *unit) { harm(); }                                                                    \
    static enum status terminate_##harm(Unit *unit) {                                                                  \
        harm();                                                                                                        \
        return OK;                                                                                                     \
    }                                                                                                                  \
    MODEL(harm##_in_step, NULL, NULL, NULL, step_##harm)                                                               \
    MODEL(harm##_in_instantiate, call_##harm, NULL, NULL, integrate)                                                   \
    MODEL(harm##_in_terminate, NULL, NULL, NULL, integrate, .terminate = terminate_##harm)                             \
    MODEL(harm##_in_free, NULL, NULL, NULL, integrate, .freed = call_##harm)                                           \
    MODEL(harm##_in_load, NULL, NULL, NULL, integrate)                                                                 \
    MODEL(harm##_in_unload, NULL, NULL, NULL, integrate)
HARMS(IN_EACH_CALL)

static enum status answer_error(Unit *unit) {
    say(unit, ERROR, "the licence cannot be returned");
    return ERROR;
}
MODEL(error_in_terminate, NULL, NULL, NULL, integrate, .terminate = answer_error)

/* Of the library's copies, one in each FMU, only that of the unit with this name does harm. */
static void do_harm(const char *when) {
    Dl_info found;
    if (!dladdr((void *)do_harm, &found))
        return;
    const char *slash = strrchr(found.dli_fname, '/'), *file = slash ? slash + 1 : found.dli_fname;
    const char *in = strstr(file, when);
    if (!in)
        return;
#define IF_NAMED(harm)                                                                                                 \
    if (sizeof #harm - 1 == (size_t)(in - file) && !strncmp(file, #harm, sizeof #harm - 1))                            \
        harm();
    HARMS(IF_NAMED)
}

__attribute__((constructor)) static void loaded(void) { do_harm("_in_load."); }
__attribute__((destructor)) static void unloaded(void) { do_harm("_in_unload."); }
