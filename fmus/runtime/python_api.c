#include "python_api.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "platform.h"

PythonApi py;

#define OLDEST_MINOR 10

/* What `fmus/interpreter.py` tells of an interpreter; empty strings where it does not know. */
typedef struct {
    char *executable;
    char *library;
} Interpreter;

static void interpreter_clear(Interpreter *found) {
    free(found->executable);
    free(found->library);
    *found = (Interpreter){0};
}

/* Reads lines such as `library = /usr/lib/libpython3.11.so`; changes `lines`. */
static Interpreter interpreter_of(char *lines) {
    Interpreter found = {0};
    for (char *line = strtok(lines, "\r\n"); line; line = strtok(NULL, "\r\n")) {
        if (strncmp(line, "executable = ", 13) == 0 && !found.executable) found.executable = copy_of(line + 13);
        if (strncmp(line, "library = ", 10) == 0 && !found.library) found.library = copy_of(line + 10);
    }
    return found;
}

static bool load_functions(void *library, const char *from, Text *tried) {
#define LOAD(Result, name, Arguments)                                                                     \
    if (!(py.name = (Result(*) Arguments)platform_function(library, #name))) {                            \
        text_add(tried, "\n  %s: has no function %s; it is not a usable Python", from, #name);            \
        return false;                                                                                     \
    }
    PYTHON_FUNCTIONS(LOAD)
#undef LOAD
    int minor = strncmp(py.Py_GetVersion(), "3.", 2) == 0 ? atoi(py.Py_GetVersion() + 2) : 0;
    if (minor >= OLDEST_MINOR) return true;
    text_add(tried, "\n  %s: Python %.6s is too old, 3.%d or later is needed", from, py.Py_GetVersion(), OLDEST_MINOR);
    return false;
}

/* The interpreter that a library belongs to lies in a folder `bin` beside or above it (Windows asks for no help). */
static char *executable_near(const char *library) {
    char *folder = copy_of(library);
    char *slash;
    int minor = atoi(py.Py_GetVersion() + 2);
    for (int up = 0; up < 4 && folder && (slash = strrchr(folder, '/')) != NULL; up++) {
        *slash = 0;
        Text candidate = {0};
        text_add(&candidate, "%s/bin/python3.%d", folder, minor);
        if (platform_exists(text_of(&candidate))) {
            free(folder);
            return candidate.chars;
        }
        text_clear(&candidate);
    }
    free(folder);
    return NULL;
}

/* The interpreter's own path is how Python finds its standard library and, in a virtual environment, its packages. */
static void tell_program_name(void *library, const char *executable) {
    void (*set)(const wchar_t *) = (void (*)(const wchar_t *))platform_function(library, "Py_SetProgramName");
    if (set && executable && platform_exists(executable)) set(py.Py_DecodeLocale(executable, NULL));
}

static void initialise(void) {
    py.Py_InitializeEx(0);  /* 0: signals stay the host's */
    py.PyEval_SaveThread(); /* every call takes the lock for itself, from whatever thread it comes */
}

static bool start(const Interpreter *found, const char *from, Text *tried) {
    text_add(tried, "\n  %s: ", from);
    void *library = platform_open_library(found->library, tried);
    if (!library) return false;
    if (!load_functions(library, found->library, tried)) {
        platform_close_library(library); /* its symbols would stand before those of the next */
        return false;
    }
    if (py.Py_IsInitialized()) return true;
    char *guess = found->executable ? NULL : executable_near(found->library);
    tell_program_name(library, found->executable ? found->executable : guess);
    free(guess);
    initialise();
    return true;
}

static bool use_loaded(Text *tried) {
    void *process = platform_loaded_python();
    if (!process) {
        text_add(tried, "\n  this process: no Python is loaded");
        return false;
    }
    if (!load_functions(process, "the Python in this process", tried)) return false;
    if (!py.Py_IsInitialized()) initialise();
    return true;
}

static bool use_environment(Text *tried) {
    Interpreter found = {.library = platform_environment("FMU_LIBPYTHON")};
    bool done = found.library && start(&found, "FMU_LIBPYTHON", tried);
    if (!found.library) text_add(tried, "\n  FMU_LIBPYTHON: not set");
    interpreter_clear(&found);
    return done;
}

static bool use_description(char *lines, const char *from, Text *tried) {
    Interpreter found = lines ? interpreter_of(lines) : (Interpreter){0};
    bool done = false;
    if (!lines)
        text_add(tried, "\n  %s: cannot be read", from);
    else if (!found.library || !*found.library)
        text_add(tried, "\n  %s: %s is built without a shared library of Python", from,
                 found.executable ? found.executable : "the interpreter");
    else
        done = start(&found, from, tried);
    interpreter_clear(&found);
    free(lines);
    return done;
}

static bool search(const char *resources, Text *tried) {
    if (use_loaded(tried) || use_environment(tried)) return true;
    Text noted = {0}, script = {0};
    text_add(&noted, "%s/python.txt", resources);
    text_add(&script, "%s/sources/fmus/interpreter.py", resources);
    bool done = use_description(platform_read_file(text_of(&noted)), "resources/python.txt", tried) ||
                use_description(platform_run("python3", text_of(&script)), "python3 on the PATH", tried);
    text_clear(&noted);
    text_clear(&script);
    return done;
}

bool python_attach(const char *resources, Text *tried) {
    static atomic_flag busy = ATOMIC_FLAG_INIT;
    static bool attached = false;
    while (atomic_flag_test_and_set(&busy)) {
    }
    if (!attached || !py.Py_IsInitialized()) {
        text_add(tried, "no usable Python; tried in this order:");
        attached = search(resources, tried);
        text_add(tried,
                 "\nCure: set the environment variable FMU_LIBPYTHON to the shared library of a Python 3.%d or later "
                 "that has the packages of this unit, such as /usr/lib/x86_64-linux-gnu/libpython3.11.so.1.0 "
                 "(python311.dll, libpython3.11.dylib). A Python without one is rebuilt with ./configure "
                 "--enable-shared (pyenv: PYTHON_CONFIGURE_OPTS=--enable-shared pyenv install 3.11).",
                 OLDEST_MINOR);
    }
    bool result = attached;
    atomic_flag_clear(&busy);
    return result;
}
