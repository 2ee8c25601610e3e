/* The process of one unit: loads its library and makes the calls that the master asks for.
 *
 * unit_process FILE SIZE MASTER SOCKET: descriptor and size of the shared memory, the master's process, the socket. */
#define _GNU_SOURCE
#include "unit_process.h"

#include <dlfcn.h>
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#define AS_ENTRY(name, shape) {#name, shape, NULL},
Entry entries[N_CALLS] = {CALLS(AS_ENTRY)};

static void *library;
static pid_t master;

/* Ends the process with the master, whatever the unit does meanwhile, and with it its group, thus what the unit has
 * forked. (The system's own signal for that comes when the master's thread ends that started the process, which may be
 * before its end.) */
static void *watch_master(void *unused) {
    const struct timespec pause = {0, 50000000};
    while (getppid() == master)
        nanosleep(&pause, NULL);
    kill(0, SIGKILL);
    return unused;
}

static void start_watching(void) {
    sigset_t all, before;
    pthread_t thread;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before); /* the unit's signals are for its own threads */
    if (pthread_create(&thread, NULL, watch_master, NULL))
        _exit(70);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
}

/* Load the library as the master would: in its own folder, as some look there for others. */
int load_library(const char *path, const char *prefix) {
    char *folder = strdup(path), *end = strrchr(folder, '/'), *here = getcwd(NULL, 0);
    if (end)
        *end = 0;
    if (chdir(folder))
        add_log(ERROR, "its folder cannot be entered");
    library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library)
        add_log(ERROR, dlerror());
    if (here && chdir(here))
        add_log(WARNING, "the working directory cannot be entered again");
    free(folder);
    free(here);
    if (!library)
        return ERROR;
    for (int i = 0; i < N_CALLS; i++) {
        Entry *entry = &entries[i];
        if (strncmp(entry->name, prefix, strlen(prefix)))
            continue;
        *(void **)&entry->function = dlsym(library, entry->name);
        if (!entry->function) {
            add_log(ERROR, dlerror());
            return ERROR;
        }
    }
    return OK;
}

void unload_library(void) {
    if (library)
        dlclose(library);
}

int main(int n, char *arguments[]) {
    if (n != 5) {
        fprintf(stderr, "this program is started by the master, for a unit in a process of its own\n");
        return 64;
    }
    int file = atoi(arguments[1]);
    size_t size = strtoull(arguments[2], NULL, 10);
    master = (pid_t)atol(arguments[3]);
    void *memory = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_NORESERVE, file, 0);
    if (memory == MAP_FAILED) {
        perror("the memory shared with the master");
        return 71;
    }
    close(file);
    start_watching();
    serve(&(Channel){.shared = memory, .side = UNIT, .socket = atoi(arguments[4])}, size);
}
