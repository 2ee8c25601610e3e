/* The process of one unit: loads its library and makes the calls that the master asks for.
 *
 * unit_process FILE SIZE MASTER SOCKET LIBPYTHON PATH: descriptor and size of the shared memory, the master's process,
 * the socket; and for a library that uses Python without naming its library: that library, empty if there is none, and
 * the PATH by which it finds the rest of that Python. */
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
static const char *libpython, *path_of_python;

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

/* Whether the linker's message is of a symbol of Python's C API, as `undefined symbol: _Py_NoneStruct` (Linux) or `symbol
 * not found in flat namespace '_PyBool_FromLong'` (macOS, where each name begins with another underscore). */
static bool lacks_python(const char *message) {
    static const char *const before[] = {"undefined symbol: ", "flat namespace '_"};
    for (int i = 0; i < 2; i++) {
        const char *name = strstr(message, before[i]);
        if (!name)
            continue;
        name += strlen(before[i]);
        if (!strncmp(name, "Py", 2) || !strncmp(name, "_Py", 3))
            return true;
    }
    return false;
}

/* Load a library, and Python's before it if it takes for granted that its host is Python, which has that loaded. */
static void *load(const char *path) {
    void *loaded = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (loaded)
        return loaded;
    const char *message = dlerror();
    if (!lacks_python(message) || !*libpython) {
        add_log(ERROR, message);
        return NULL;
    }
    setenv("PATH", path_of_python, 1);
    loaded = dlopen(libpython, RTLD_NOW | RTLD_GLOBAL) ? dlopen(path, RTLD_NOW | RTLD_LOCAL) : NULL;
    if (!loaded)
        add_log(ERROR, dlerror());
    return loaded;
}

/* Load the library as the master would: in its own folder, as some look there for others. */
int load_library(const char *path, const char *prefix) {
    char *folder = strdup(path), *end = strrchr(folder, '/'), *here = getcwd(NULL, 0);
    if (end)
        *end = 0;
    if (chdir(folder))
        add_log(ERROR, "its folder cannot be entered");
    library = load(path);
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
    if (n != 7) {
        fprintf(stderr, "this program is started by the master, for a unit in a process of its own\n");
        return 64;
    }
    int file = atoi(arguments[1]);
    size_t size = strtoull(arguments[2], NULL, 10);
    master = (pid_t)atol(arguments[3]);
    libpython = arguments[5];
    path_of_python = arguments[6];
    void *memory = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_NORESERVE, file, 0);
    if (memory == MAP_FAILED) {
        perror("the memory shared with the master");
        return 71;
    }
    close(file);
    start_watching();
    serve(&(Channel){.shared = memory, .side = UNIT, .socket = atoi(arguments[4])}, size);
}
