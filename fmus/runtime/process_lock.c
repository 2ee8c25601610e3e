#define _GNU_SOURCE
#include "process_lock.h"

#define NAME "handover-fmi-python-"

#ifdef _WIN32
#include <wchar.h>
#include <windows.h>

bool process_lock(ProcessLock *lock, Text *fault) {
    wchar_t name[64];
    swprintf(name, sizeof name / sizeof *name, L"Local\\" NAME L"%lu", GetCurrentProcessId());
    HANDLE mutex = CreateMutexW(NULL, FALSE, name);
    *lock = (ProcessLock){.handle = (intptr_t)mutex};
    if (mutex && WaitForSingleObject(mutex, INFINITE) != WAIT_FAILED) return true;
    text_add(fault, "\n  this process: the lock for starting Python failed with code %lu", GetLastError());
    if (mutex) CloseHandle(mutex);
    return false;
}

void process_unlock(ProcessLock *lock) {
    ReleaseMutex((HANDLE)lock->handle);
    CloseHandle((HANDLE)lock->handle);
}

#else
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

/* Opens and locks the file; -1 if it cannot be had, -2 if the one who had the lock removed it meanwhile. */
static int locked_file(const char *path) {
    int file = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (file < 0) return -1;
    struct stat ours, there;
    int done = fstat(file, &ours);
    if (done == 0 && ours.st_uid != geteuid()) { /* of another user, who could keep us waiting */
        done = -1;
        errno = EACCES;
    }
    while (done == 0 && (done = flock(file, LOCK_EX)) != 0 && errno == EINTR) done = 0;
    if (done != 0) {
        int why = errno;
        close(file);
        errno = why;
        return -1;
    }
    if (stat(path, &there) == 0 && there.st_ino == ours.st_ino && there.st_dev == ours.st_dev) return file;
    close(file);
    return -2;
}

bool process_lock(ProcessLock *lock, Text *fault) {
    const char *folders[] = {getenv("TMPDIR"), "/tmp", "/var/tmp"};
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++) {
        if (!folders[i] || !*folders[i]) continue;
        *lock = (ProcessLock){0};
        text_add(&lock->path, "%s/" NAME "%ld", folders[i], (long)getpid());
        do {
            lock->handle = locked_file(text_of(&lock->path));
        } while (lock->handle == -2);
        if (lock->handle >= 0) return true;
        text_add(fault, "\n  this process: the lock %s: %s; a temporary folder (TMPDIR) must be writable",
                 text_of(&lock->path), strerror(errno));
        text_clear(&lock->path);
    }
    return false;
}

void process_unlock(ProcessLock *lock) {
    unlink(text_of(&lock->path)); /* before the lock goes: whoever waits for this file sees that it is gone */
    close((int)lock->handle);
    text_clear(&lock->path);
}

#endif
