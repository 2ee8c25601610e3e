#define _GNU_SOURCE
#include "platform.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define PSAPI_VERSION 2
#include <fcntl.h>
#include <io.h>
#include <windows.h>

#include <psapi.h>
#else
#include <dlfcn.h>
#include <errno.h>
#include <sys/stat.h>
#include <unistd.h>
#ifdef __APPLE__
#include <mach-o/dyld.h>
#else
#include <link.h>
#endif
#endif

static char *read_all(FILE *file) {
    Text text = {0};
    char block[4096];
    size_t n;
    while ((n = fread(block, 1, sizeof block, file)) > 0) text_add(&text, "%.*s", (int)n, block);
    return text.chars ? text.chars : copy_of("");
}

#ifdef _WIN32

static wchar_t *wide(const char *utf8) {
    int n = MultiByteToWideChar(CP_UTF8, 0, utf8, -1, NULL, 0);
    wchar_t *w = malloc(sizeof(wchar_t) * (size_t)(n > 0 ? n : 1));
    if (w && MultiByteToWideChar(CP_UTF8, 0, utf8, -1, w, n) == 0) *w = 0;
    return w;
}

static char *narrow(const wchar_t *w) {
    int n = WideCharToMultiByte(CP_UTF8, 0, w, -1, NULL, 0, NULL, NULL);
    char *utf8 = malloc((size_t)(n > 0 ? n : 1));
    if (utf8 && WideCharToMultiByte(CP_UTF8, 0, w, -1, utf8, n, NULL, NULL) == 0) *utf8 = 0;
    return utf8;
}

void *platform_open_library(const char *path, Text *fault) {
    wchar_t *w = wide(path);
    for (wchar_t *c = w; c && *c; c++)
        if (*c == L'/') *c = L'\\'; /* the loader's rules speak of these only */
    DWORD how = w && wcschr(w, L'\\') ? LOAD_WITH_ALTERED_SEARCH_PATH : 0; /* what it needs lies beside it */
    void *library = w ? (void *)LoadLibraryExW(w, NULL, how) : NULL;
    if (!library) text_add(fault, "%s: LoadLibrary failed with code %lu", path, GetLastError());
    free(w);
    return library;
}

void platform_close_library(void *library) { FreeLibrary((HMODULE)library); }

AnyFunction platform_function(void *library, const char *name) {
    return (AnyFunction)GetProcAddress((HMODULE)library, name);
}

void *platform_loaded_python(void) {
    HMODULE modules[1024];
    DWORD needed = 0;
    if (!EnumProcessModules(GetCurrentProcess(), modules, sizeof modules, &needed)) return NULL;
    size_t n = needed < sizeof modules ? needed / sizeof *modules : sizeof modules / sizeof *modules;
    for (size_t i = 0; i < n; i++)
        if (GetProcAddress(modules[i], "Py_IsInitialized")) return (void *)modules[i];
    return NULL;
}

char *platform_environment(const char *name) {
    wchar_t *w = wide(name);
    const wchar_t *value = w ? _wgetenv(w) : NULL;
    free(w);
    return value && *value ? narrow(value) : NULL;
}

bool platform_exists(const char *path) {
    wchar_t *w = wide(path);
    bool there = w && GetFileAttributesW(w) != INVALID_FILE_ATTRIBUTES;
    free(w);
    return there;
}

char *platform_real_path(const char *path) { return copy_of(path); }

bool platform_make_executable(const char *path, Text *fault) {
    (void)path, (void)fault; /* by its name it is */
    return true;
}

char *platform_read_file(const char *path) {
    wchar_t *w = wide(path);
    FILE *file = w ? _wfopen(w, L"rb") : NULL;
    free(w);
    char *text = file ? read_all(file) : NULL;
    if (file) fclose(file);
    return text;
}

/* Starts a process that writes to a pipe. Not by _wpopen, which a host with windows and no console cannot use. */
static HANDLE start(wchar_t *command, HANDLE in) {
    STARTUPINFOW streams = {.cb = sizeof streams, .dwFlags = STARTF_USESTDHANDLES, .hStdOutput = in};
    PROCESS_INFORMATION made;
    BOOL started = CreateProcessW(NULL, command, NULL, NULL, TRUE, CREATE_NO_WINDOW, NULL, NULL, &streams, &made);
    if (started) CloseHandle(made.hThread);
    return started ? made.hProcess : NULL;
}

/* Reads what comes out of a pipe; closes it. */
static char *drained(HANDLE out) {
    int number = _open_osfhandle((intptr_t)out, _O_RDONLY | _O_BINARY);
    FILE *file = number >= 0 ? _fdopen(number, "rb") : NULL;
    char *output = file ? read_all(file) : NULL;
    if (file) fclose(file);
    return output;
}

char *platform_run(const char *interpreter, const char *script) {
    Text command = {0};
    text_add(&command, "\"%s\" \"%s\"", interpreter, script);
    wchar_t *w = wide(text_of(&command));
    text_clear(&command);
    SECURITY_ATTRIBUTES inherited = {.nLength = sizeof inherited, .bInheritHandle = TRUE};
    HANDLE out, in;
    if (!w || !CreatePipe(&out, &in, &inherited, 0)) return free(w), NULL;
    SetHandleInformation(out, HANDLE_FLAG_INHERIT, 0);
    HANDLE process = start(w, in);
    CloseHandle(in); /* else reading from the pipe never ends */
    free(w);
    char *output = drained(out);
    DWORD status = 1;
    if (process && WaitForSingleObject(process, INFINITE) == WAIT_OBJECT_0) GetExitCodeProcess(process, &status);
    if (process) CloseHandle(process);
    if (status == 0) return output;
    free(output);
    return NULL;
}

#else

void *platform_open_library(const char *path, Text *fault) {
    void *library = dlopen(path, RTLD_NOW | RTLD_GLOBAL); /* extension modules look for Python's symbols globally */
    if (!library) text_add(fault, "%s", dlerror());
    return library;
}

void platform_close_library(void *library) { dlclose(library); }

AnyFunction platform_function(void *library, const char *name) {
    AnyFunction function = NULL;
    void *address = dlsym(library, name);
    memcpy(&function, &address, sizeof function);
    return function;
}

static bool is_libpython(const char *path) {
    const char *slash = strrchr(path, '/');
    const char *name = slash ? slash + 1 : path;
    return strncmp(name, "libpython", 9) == 0 || strcmp(name, "Python") == 0;
}

#ifdef __APPLE__
static char *path_of_loaded_libpython(void) {
    for (uint32_t i = 0; i < _dyld_image_count(); i++)
        if (is_libpython(_dyld_get_image_name(i))) return copy_of(_dyld_get_image_name(i));
    return NULL;
}
#else
static int keep_libpython(struct dl_phdr_info *info, size_t size, void *found) {
    (void)size;
    if (!info->dlpi_name || !is_libpython(info->dlpi_name)) return 0;
    *(char **)found = copy_of(info->dlpi_name);
    return 1;
}

static char *path_of_loaded_libpython(void) {
    char *found = NULL;
    dl_iterate_phdr(keep_libpython, &found);
    return found;
}
#endif

void *platform_loaded_python(void) {
    void *process = dlopen(NULL, RTLD_NOW);
    if (process && dlsym(process, "Py_IsInitialized")) return process;
    char *path = path_of_loaded_libpython(); /* loaded without making its symbols global */
    void *library = path ? dlopen(path, RTLD_NOW | RTLD_NOLOAD | RTLD_GLOBAL) : NULL;
    free(path);
    return library && dlsym(library, "Py_IsInitialized") ? library : NULL;
}

char *platform_environment(const char *name) {
    const char *value = getenv(name);
    return value && *value ? copy_of(value) : NULL;
}

bool platform_exists(const char *path) {
    struct stat facts;
    return stat(path, &facts) == 0;
}

char *platform_real_path(const char *path) { return realpath(path, NULL); }

bool platform_make_executable(const char *path, Text *fault) {
    struct stat facts;
    if (access(path, X_OK) == 0) return true;
    if (stat(path, &facts) == 0 && chmod(path, facts.st_mode | S_IXUSR | S_IXGRP | S_IXOTH) == 0 &&
        access(path, X_OK) == 0)
        return true;
    text_add(fault, "%s cannot be executed: %s", path, strerror(errno));
    return false;
}

char *platform_read_file(const char *path) {
    FILE *file = fopen(path, "rb");
    char *text = file ? read_all(file) : NULL;
    if (file) fclose(file);
    return text;
}

static void add_quoted(Text *command, const char *word) {
    text_add(command, "'");
    for (; *word; word++) text_add(command, "%s%c", *word == '\'' ? "'\\'" : "", *word);
    text_add(command, "' ");
}

char *platform_run(const char *interpreter, const char *script) {
    Text command = {0};
    add_quoted(&command, interpreter);
    add_quoted(&command, script);
    text_add(&command, "2>/dev/null");
    FILE *pipe = popen(text_of(&command), "r");
    text_clear(&command);
    if (!pipe) return NULL;
    char *output = read_all(pipe);
    if (pclose(pipe) == 0) return output;
    free(output);
    return NULL;
}

#endif

static int hexadecimal(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

static void decode_percents(char *string) {
    char *to = string;
    for (const char *from = string; *from; from++, to++) {
        int high = *from == '%' ? hexadecimal(from[1]) : -1;
        int low = high >= 0 ? hexadecimal(from[2]) : -1;
        *to = low >= 0 ? (char)(high * 16 + low) : *from;
        if (low >= 0) from += 2;
    }
    *to = 0;
}

char *platform_path(const char *uri_or_path) {
    bool is_uri = strncmp(uri_or_path, "file:", 5) == 0;
    const char *start = is_uri ? uri_or_path + 5 : uri_or_path;
    if (is_uri && strncmp(start, "//", 2) == 0) { /* file://host/path: the host is this one */
        const char *slash = strchr(start + 2, '/');
        start = slash ? slash : start + 2;
    }
    char *path = copy_of(start);
    if (!path) return NULL;
    if (is_uri) decode_percents(path);
#ifdef _WIN32
    if (is_uri && path[0] == '/' && path[1] && path[2] == ':') memmove(path, path + 1, strlen(path)); /* /C:/... */
#endif
    for (size_t n = strlen(path); n > 1 && (path[n - 1] == '/' || path[n - 1] == '\\'); n--) path[n - 1] = 0;
    return path;
}
