#ifndef _WIN32
#define _GNU_SOURCE
#include "process_posix.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#ifdef __APPLE__
#include <crt_externs.h>
#define environ (*_NSGetEnviron())
#else
extern char **environ;
#endif

#ifndef MSG_NOSIGNAL
#define MSG_NOSIGNAL 0 /* a Mac has the option SO_NOSIGPIPE instead */
#endif

#define CHANNEL 3 /* the descriptors' numbers in the process */
#define MEMORY 4
#define MOST_ARGUMENTS 8
#define MOST_VARIABLES 3
#define POLL_INTERVAL 500 /* ms: a silent process may be over, while one that it made holds the channel open */

double process_clock(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

bool process_open_channel(int ends[2]) {
#ifdef SOCK_CLOEXEC
    return socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0;
#else
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends) != 0) return false;
    int on = 1;
    for (int i = 0; i < 2; i++) {
        fcntl(ends[i], F_SETFD, FD_CLOEXEC);
        setsockopt(ends[i], SOL_SOCKET, SO_NOSIGPIPE, &on, sizeof on);
    }
    return true;
#endif
}

/* The process begins with no signal blocked and none ignored; in a group of its own, so that what it starts ends with
 * it, and the terminal's Ctrl-C is the host's business. */
static void set_attributes(posix_spawnattr_t *attributes) {
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    sigdelset(&all, SIGKILL);
    sigdelset(&all, SIGSTOP);
    short flags = POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF;
#ifdef POSIX_SPAWN_CLOEXEC_DEFAULT
    flags |= POSIX_SPAWN_CLOEXEC_DEFAULT;
#endif
    posix_spawnattr_setflags(attributes, flags);
    posix_spawnattr_setpgroup(attributes, 0);
    posix_spawnattr_setsigmask(attributes, &none);
    posix_spawnattr_setsigdefault(attributes, &all);
}

/* Fills the environment of a bundled program, whose strings are the host's: `libraries`, where its own lie, and of the
 * host's variables those that say where it may write. All others could change what the unit computes, such as a search
 * path, a locale, or the settings of a package. */
static void fill_environment(char *variables[MOST_VARIABLES + 1], const char *libraries) {
    const char *passed_on[] = {"HOME=", "TMPDIR="};
    size_t n = 0;
    variables[n++] = (char *)libraries;
    for (size_t k = 0; k < sizeof passed_on / sizeof *passed_on; k++)
        for (char **variable = environ; variable && *variable; variable++)
            if (strncmp(*variable, passed_on[k], strlen(passed_on[k])) == 0) {
                variables[n++] = *variable;
                break;
            }
    variables[n] = NULL;
}

/* `channel` and `memory` are not among the numbers that they get: dup2 onto itself would not let them be inherited. */
static int spawn(pid_t *id, const char *program, char *const arguments[], int channel, int memory, char **environment) {
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_init(&actions);
    posix_spawnattr_init(&attributes);
    if (access("/dev/null", R_OK) == 0) /* a bare root folder may have none */
        posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    else if (fcntl(0, F_GETFD) >= 0)
        posix_spawn_file_actions_addclose(&actions, 0);
    posix_spawn_file_actions_adddup2(&actions, channel, CHANNEL);
    if (memory >= 0) posix_spawn_file_actions_adddup2(&actions, memory, MEMORY);
#ifdef POSIX_SPAWN_CLOEXEC_DEFAULT
    for (int i = 1; i <= 2; i++)
        if (fcntl(i, F_GETFD) >= 0) posix_spawn_file_actions_adddup2(&actions, i, i);
#endif
    set_attributes(&attributes);
    int fault = posix_spawnp(id, program, &actions, &attributes, arguments, environment);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    return fault;
}

typedef struct {
    char *list[MOST_ARGUMENTS + 5]; /* the program, its arguments, three numbers, NULL */
    char host[24];
} Command;

/* Adds the numbers of this process and of the descriptors to the arguments. */
static void fill_command(Command *command, const char *program, const char *const arguments[], bool with_memory) {
    int n = 0;
    snprintf(command->host, sizeof command->host, "%ld", (long)getpid());
    command->list[n++] = (char *)program;
    for (; *arguments && n <= MOST_ARGUMENTS; arguments++) command->list[n++] = (char *)*arguments;
    command->list[n++] = command->host;
    command->list[n++] = "3";
    command->list[n++] = with_memory ? "4" : NULL;
    command->list[n] = NULL;
}

Process *process_start(const char *interpreter, const char *const arguments[], const SharedMemory *memory, Text *fault) {
    Command command;
    fill_command(&command, interpreter, arguments, true);
    int ends[2];
    if (!process_open_channel(ends)) {
        text_add(fault, "no channel to it: %s", strerror(errno));
        return NULL;
    }
    int channel = fcntl(ends[1], F_DUPFD_CLOEXEC, 10), shared = fcntl((int)memory->file, F_DUPFD_CLOEXEC, 10);
    Process *process = calloc(1, sizeof *process);
    int why = channel < 0 || shared < 0 ? errno : process ? 0 : ENOMEM;
    if (!why) why = spawn(&process->id, interpreter, command.list, channel, shared, environ);
    close(ends[1]);
    if (channel >= 0) close(channel);
    if (shared >= 0) close(shared);
    if (!why) {
        process->channel = ends[0];
        process->host = getpid();
        return process;
    }
    close(ends[0]);
    free(process);
    text_add(fault, "%s", strerror(why));
    return NULL;
}

bool process_start_alone(const char *program, const char *const arguments[], pid_t *id, int *control, Text *fault) {
    Command command;
    fill_command(&command, program, arguments, false);
    int ends[2];
    if (!process_open_channel(ends)) {
        text_add(fault, "no channel to it: %s", strerror(errno));
        return false;
    }
    Text libraries = {0}; /* the program is linked to some that it brings */
    text_add(&libraries, "LD_LIBRARY_PATH=%.*s/_internal", (int)(strrchr(program, '/') - program), program);
    char *environment[MOST_VARIABLES + 1];
    fill_environment(environment, text_of(&libraries));
    int channel = fcntl(ends[1], F_DUPFD_CLOEXEC, 10);
    int why = channel < 0 ? errno : spawn(id, program, command.list, channel, -1, environment);
    text_clear(&libraries);
    close(ends[1]);
    if (channel >= 0) close(channel);
    *control = ends[0];
    if (!why) return true;
    close(ends[0]);
    text_add(fault, "%s", strerror(why));
    return false;
}

Life process_life(pid_t id) {
    siginfo_t info = {0};
    if (waitid(P_PID, (id_t)id, &info, WEXITED | WNOHANG | WNOWAIT) != 0) return errno == ECHILD ? IS_REAPED : RUNS;
    return info.si_pid == id ? IS_OVER : RUNS;
}

bool process_runs(const Process *process) { return process_life(process->id) == RUNS; }

/* Waits until the channel is ready for what `events` says. */
static Transfer await_channel(const Process *process, short events, double deadline) {
    for (;;) {
        double left = ceil(1e3 * (deadline - process_clock()));
        struct pollfd channel = {.fd = process->channel, .events = events};
        int n = poll(&channel, 1, left < POLL_INTERVAL ? (left > 0 ? (int)left : 0) : POLL_INTERVAL);
        if (n > 0) return TRANSFERRED;
        if (n < 0 && errno != EINTR && errno != EAGAIN) return ENDED;
        if (n == 0 && process_life(process->id) != RUNS) return ENDED;
        if (n == 0 && left <= POLL_INTERVAL) return TOO_LATE;
    }
}

static bool is_passing(int fault) { return fault == EAGAIN || fault == EWOULDBLOCK || fault == EINTR; }

Transfer process_send(Process *process, const void *bytes, size_t size, double deadline) {
    for (const char *from = bytes; size > 0;) {
        ssize_t n = send(process->channel, from, size, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (n < 0 && !is_passing(errno)) return ENDED;
        if (n > 0) {
            from += n;
            size -= (size_t)n;
            continue;
        }
        Transfer ready = await_channel(process, POLLOUT, deadline);
        if (ready != TRANSFERRED) return ready;
    }
    return TRANSFERRED;
}

Transfer process_receive(Process *process, void *bytes, size_t size, double deadline) {
    for (char *to = bytes; size > 0;) {
        Transfer ready = await_channel(process, POLLIN, deadline);
        if (ready != TRANSFERRED) return ready;
        ssize_t n = recv(process->channel, to, size, MSG_DONTWAIT);
        if (n == 0 || (n < 0 && !is_passing(errno))) return ENDED;
        if (n < 0) continue;
        to += n;
        size -= (size_t)n;
    }
    return TRANSFERRED;
}

void process_describe(int status, Text *how) {
    if (WIFSIGNALED(status)) {
        int number = WTERMSIG(status);
        const char *meaning = number == SIGSEGV || number == SIGBUS || number == SIGILL || number == SIGFPE
                                  ? "; compiled code of a package has crashed"
                                  : "";
        text_add(how, "ended by signal %d (%s)%s", number, strsignal(number), meaning);
    } else {
        text_add(how, "ended with exit status %d", WEXITSTATUS(status));
    }
}

static void await_end(pid_t id, double patience) {
    double deadline = process_clock() + patience;
    while (process_life(id) == RUNS && process_clock() < deadline) nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
}

bool process_reap(pid_t id, double patience, int *status) {
    await_end(id, patience);
    if (process_life(id) == IS_REAPED) return false;
    kill(-id, SIGKILL); /* also what it started; until it is reaped its number is no one else's */
    pid_t reaped;
    do {
        reaped = waitpid(id, status, 0);
    } while (reaped < 0 && errno == EINTR);
    return reaped == id;
}

/* Whether the other end of the channel is closed: the process is over, or about to be. */
static bool has_hung_up(const Process *process) {
    struct pollfd channel = {.fd = process->channel};
    return poll(&channel, 1, 0) > 0 && (channel.revents & POLLHUP);
}

int process_end(Process *process, double patience, Text *how) {
    bool ours = process->host == getpid(), reaped = false, was_silent = false;
    int status = 0;
    if (ours && process->shared && has_hung_up(process)) await_end(process->id, patience);
    if (ours) shutdown(process->channel, SHUT_RDWR); /* also for those who have it by a fork of the host */
    close(process->channel);
    if (ours && process->shared)
        reaped = process_leave(process->shared, patience, &status, &was_silent);
    else if (ours)
        reaped = process_reap(process->id, patience, &status);
    if (was_silent)
        text_add(how, "was ended, as it did not answer another instance of the unit in time");
    else if (reaped)
        process_describe(status, how);
    else
        text_add(how, process->shared ? "ended for this instance" : "ended; the host took note of how for itself");
    free(process);
    return reaped && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

#endif
