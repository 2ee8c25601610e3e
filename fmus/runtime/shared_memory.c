#define _GNU_SOURCE
#include "shared_memory.h"

#ifdef _WIN32
#include <windows.h>

bool shared_memory_open(SharedMemory *memory, Text *fault) {
    wchar_t folder[MAX_PATH + 1], path[MAX_PATH + 1];
    *memory = NO_SHARED_MEMORY;
    if (GetTempPathW(MAX_PATH, folder) && GetTempFileNameW(folder, L"fmu", 0, path)) {
        HANDLE file = CreateFileW(path, GENERIC_READ | GENERIC_WRITE,
                                  FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, NULL, CREATE_ALWAYS,
                                  FILE_ATTRIBUTE_TEMPORARY | FILE_FLAG_DELETE_ON_CLOSE, NULL);
        if (file != INVALID_HANDLE_VALUE) {
            memory->file = (intptr_t)file;
            return true;
        }
    }
    text_add(fault, "\n  shared memory: a temporary file cannot be made, code %lu", GetLastError());
    return false;
}

bool shared_memory_map(SharedMemory *memory, size_t size, Text *fault) {
    if (memory->address && memory->size == size) return true;
    HANDLE mapping = memory->address ? NULL : CreateFileMappingW((HANDLE)memory->file, NULL, PAGE_READWRITE, 0, 0, NULL);
    memory->address = mapping ? MapViewOfFile(mapping, FILE_MAP_ALL_ACCESS, 0, 0, size) : memory->address;
    if (mapping) CloseHandle(mapping); /* the view keeps it */
    bool mapped = mapping && memory->address;
    if (mapped)
        memory->size = size;
    else
        text_add(fault, "%zu bytes of shared memory cannot be mapped, code %lu", size, GetLastError());
    return mapped;
}

void shared_memory_close(SharedMemory *memory) {
    if (memory->address) UnmapViewOfFile(memory->address);
    if (memory->file != -1) CloseHandle((HANDLE)memory->file);
    *memory = NO_SHARED_MEMORY;
}

#else
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>
#ifdef __linux__
#include <sys/syscall.h>
#endif

/* A file that is nowhere on a disk, or in a temporary folder without a name. */
static int nameless_file(void) {
#if defined(__linux__) && defined(SYS_memfd_create)
    long file = syscall(SYS_memfd_create, "fmu", 1u /* MFD_CLOEXEC */);
    if (file >= 0) return (int)file;
#endif
    const char *folders[] = {getenv("TMPDIR"), "/tmp", "/var/tmp"};
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++) {
        if (!folders[i] || !*folders[i]) continue;
        Text path = {0};
        text_add(&path, "%s/fmu-XXXXXX", folders[i]);
        int made = path.chars ? mkstemp(path.chars) : -1;
        if (made >= 0) {
            unlink(path.chars);
            fcntl(made, F_SETFD, FD_CLOEXEC);
        }
        text_clear(&path);
        if (made >= 0) return made;
    }
    return -1;
}

bool shared_memory_open(SharedMemory *memory, Text *fault) {
    *memory = (SharedMemory){.file = nameless_file()};
    if (memory->file >= 0) return true;
    text_add(fault, "\n  shared memory: %s; a temporary folder (TMPDIR) must be writable", strerror(errno));
    return false;
}

bool shared_memory_map(SharedMemory *memory, size_t size, Text *fault) {
    if (memory->address && memory->size == size) return true;
    void *address = MAP_FAILED;
    errno = EINVAL;
    if (!memory->address) address = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, (int)memory->file, 0);
    if (address == MAP_FAILED) {
        text_add(fault, "%zu bytes of shared memory cannot be mapped: %s", size, strerror(errno));
        return false;
    }
    memory->address = address;
    memory->size = size;
    return true;
}

void shared_memory_close(SharedMemory *memory) {
    if (memory->address) munmap(memory->address, memory->size);
    if (memory->file >= 0) close((int)memory->file);
    *memory = NO_SHARED_MEMORY;
}

#endif
