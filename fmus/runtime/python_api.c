#include "python_api.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "platform.h"
#include "process_lock.h"

PythonApi py;

#define OLDEST_MINOR 10

/* How `fmus/interpreter.py` describes an interpreter; empty strings where it does not know. */
typedef struct {
    char *executable;
    char *library;
} Interpreter;

static void interpreter_clear(Interpreter *found) {
    free(found->executable);
    free(found->library);
    *found = (Interpreter){0};
}

/* Reads lines such as `library = /usr/lib/libpython3.11.so`; changes `lines`. Without strtok, whose place in the text
 * all threads share: the host may start instances in several concurrently. */
static Interpreter interpreter_of(char *lines) {
    Interpreter found = {0};
    for (char *line = lines; *line;) {
        size_t length = strcspn(line, "\r\n");
        char *rest = line + length + (line[length] != 0);
        line[length] = 0;
        if (strncmp(line, "executable = ", 13) == 0 && !found.executable) found.executable = copy_of(line + 13);
        if (strncmp(line, "library = ", 10) == 0 && !found.library) found.library = copy_of(line + 10);
        line = rest;
    }
    return found;
}

/* Fills `py`, or leaves it as it was. */
static bool load_functions(void *library, const char *from, Text *tried) {
    PythonApi found;
#define LOAD(Result, name, Arguments)                                                                     \
    if (!(found.name = (Result(*) Arguments)platform_function(library, #name))) {                         \
        text_add(tried, "\n  %s: has no function %s; it is not a usable Python", from, #name);            \
        return false;                                                                                     \
    }
    PYTHON_FUNCTIONS(LOAD)
#undef LOAD
    const char *version = found.Py_GetVersion();
    int minor = strncmp(version, "3.", 2) == 0 ? atoi(version + 2) : 0;
    if (minor >= OLDEST_MINOR) {
        py = found;
        return true;
    }
    text_add(tried, "\n  %s: Python %.*s is too old, 3.%d or later is needed", from, (int)strcspn(version, " "), version,
             OLDEST_MINOR);
    return false;
}

/* Whether folder/pattern is there; `pattern` has a place for Python's minor version. */
static bool exists_in(const char *folder, const char *pattern, int minor) {
    Text path = {0};
    text_add(&path, "%s", folder);
    text_add(&path, pattern, minor);
    bool there = platform_exists(text_of(&path));
    text_clear(&path);
    return there;
}

static bool has_standard_library(const char *folder, int minor) {
    static const char *const places[] = {"/lib/python3.%d/os.py", "/lib64/python3.%d/os.py", "/lib/python3.%dt/os.py",
                                         "/Lib/os.py",            "/lib/python3%d.zip",      "/python3%d.zip"};
    for (size_t i = 0; i < sizeof places / sizeof *places; i++)
        if (exists_in(folder, places[i], minor)) return true;
    return false;
}

/* The folder, beside or above a library, below which its standard library lies, or NULL. */
static char *home_of(const char *library) {
    int minor = atoi(py.Py_GetVersion() + 2);
    char *folder = copy_of(library);
    for (int up = 0; up < 5 && folder; up++) {
        char *slash = strrchr(folder, '/'), *backslash = strrchr(folder, '\\');
        char *last = backslash > slash ? backslash : slash;
        if (!last || last == folder) break;
        *last = 0;
        if (has_standard_library(folder, minor)) return folder;
    }
    free(folder);
    return NULL;
}

/* By its interpreter's path Python finds its standard library and, in a virtual environment, its packages. */
static void tell_program_name(void *library, const char *executable) {
    void (*set)(const wchar_t *) = (void (*)(const wchar_t *))platform_function(library, "Py_SetProgramName");
    if (set && executable) set(py.Py_DecodeLocale(executable, NULL));
}

/* Sets a variable of Python's that is read when it starts; returns whether this Python has it. */
static bool set_flag(void *library, const char *name) {
    AnyFunction found = platform_function(library, name);
    if (!found) return false;
    int *flag;
    memcpy(&flag, &found, sizeof flag);
    *flag = 1;
    return true;
}

/* Paths are UTF-8 whatever the host's locale, which may be C; from Python 3.15 on that is the rule. */
static void prefer_utf8(void *library) { set_flag(library, "Py_UTF8Mode"); }

/* Python ends the process if it cannot start, so what could keep it from starting is checked before. Of the
 * environment it must not take PYTHONHOME and the like, which are for another Python or the host's own. */
static bool initialise(void *library, const char *from, Text *tried) {
    bool ignored = set_flag(library, "Py_IgnoreEnvironmentFlag");
    char *home = ignored ? NULL : platform_environment("PYTHONHOME");
    if (home) {
        text_add(tried, "\n  %s: PYTHONHOME is set, to %s; it must not be", from, home);
        free(home);
        return false;
    }
    prefer_utf8(library);
    py.Py_InitializeEx(0);  /* 0: signals stay the host's */
    py.PyEval_SaveThread(); /* every call takes the lock for itself, from whatever thread it comes */
    return true;
}

/* Starts the Python of a library from a file. */
static bool start_from(void *library, const Interpreter *found, const char *from, Text *tried) {
    char *real = platform_real_path(found->library);
    char *home = home_of(found->library);
    if (!home && real) home = home_of(real);
    free(real);
    bool bare = !strpbrk(found->library, "/\\"); /* found by the system, which knows where it belongs */
    bool started = false;
    if (home || bare) {
        Text guess = {0};
        prefer_utf8(library); /* before the name is decoded */
        if (home) text_add(&guess, "%s/bin/python3.%d", home, atoi(py.Py_GetVersion() + 2));
        bool known = found->executable && platform_exists(found->executable);
        tell_program_name(library, known ? found->executable : guess.chars);
        text_clear(&guess);
        started = initialise(library, from, tried);
    } else {
        text_add(tried, "\n  %s: the standard library of %s is not beside or above it", from, found->library);
    }
    free(home);
    return started;
}

static bool start(const Interpreter *found, const char *from, Text *tried) {
    text_add(tried, "\n  %s: ", from);
    void *library = platform_open_library(found->library, tried);
    if (!library) return false;
    if (load_functions(library, found->library, tried)) {
        if (py.Py_IsInitialized() || start_from(library, found, from, tried)) return true;
        py = (PythonApi){0};
    }
    platform_close_library(library); /* its symbols would stand before those of the next */
    return false;
}

static bool use_loaded(void *process, Text *tried) {
    static const char from[] = "the Python in this process";
    if (load_functions(process, from, tried)) {
        if (py.Py_IsInitialized() || initialise(process, from, tried)) return true;
        py = (PythonApi){0};
    }
    text_add(tried,
             "\nCure: there cannot be a second Python beside it. Run the host with Python 3.%d or later, or keep it "
             "from loading this one.",
             OLDEST_MINOR);
    return false;
}

#define A_LIBRARY                                                                               \
    "the shared library of a Python 3.%d or later that has the packages of this unit, such as " \
    "/usr/lib/x86_64-linux-gnu/libpython3.11.so.1.0 (python311.dll, libpython3.11.dylib)."

/* The library that the user chose; no other is tried. */
static bool use_library(char *library, Text *tried) {
    Interpreter found = {.library = library};
    bool done = start(&found, "FMU_LIBPYTHON", tried);
    text_add(tried,
             "\nWhile FMU_LIBPYTHON is set no other Python is tried.\nCure: unset it, or set it to " A_LIBRARY,
             OLDEST_MINOR);
    return done;
}

static bool use_description(char *lines, const char *from, Text *tried) {
    Interpreter found = lines ? interpreter_of(lines) : (Interpreter){0};
    bool done = false, names_library = found.library && *found.library;
    if (!lines)
        text_add(tried, "\n  %s: cannot be read", from);
    else if (!names_library && !(found.executable && *found.executable))
        text_add(tried, "\n  %s: names no interpreter", from);
    else if (!names_library)
        text_add(tried, "\n  %s: %s is built without a shared library of Python", from, found.executable);
    else
        done = start(&found, from, tried);
    interpreter_clear(&found);
    free(lines);
    return done;
}

char *python_noted(const char *resources) {
    Text path = {0};
    text_add(&path, "%s/python.txt", resources);
    char *lines = platform_read_file(text_of(&path));
    text_clear(&path);
    Interpreter found = lines ? interpreter_of(lines) : (Interpreter){0};
    char *executable = found.executable;
    found.executable = NULL;
    interpreter_clear(&found);
    free(lines);
    return executable;
}

/* The library of the interpreter that the user chose; no other is tried. */
static bool use_chosen(const char *interpreter, const char *script, Text *tried) {
    char *lines = platform_run(interpreter, script);
    if (lines && strstr(lines, "executable = ")) return use_description(lines, "FMU_PYTHON", tried);
    free(lines);
    text_add(tried, "\n  FMU_PYTHON: %s cannot be run, or is no Python 3.6 or later", interpreter);
    return false;
}

/* By the interpreter that the user chose; without one, by that which built the unit or that on the PATH. */
static bool use_interpreter(const char *resources, Text *tried) {
    Text noted = {0}, script = {0};
    text_add(&noted, "%s/python.txt", resources);
    text_add(&script, "%s/sources/handover/fmus/interpreter.py", resources);
    char *chosen = platform_environment("FMU_PYTHON");
    text_add(tried, "\n  FMU_LIBPYTHON: not set");
    bool done = chosen ? use_chosen(chosen, text_of(&script), tried)
                       : use_description(platform_read_file(text_of(&noted)), "resources/python.txt", tried) ||
                             use_description(platform_run(PYTHON_ON_PATH, text_of(&script)),
                                             PYTHON_ON_PATH " on the PATH", tried);
    free(chosen);
    text_clear(&noted);
    text_clear(&script);
    text_add(tried,
             "\nCure: set the environment variable FMU_LIBPYTHON to " A_LIBRARY
             " A Python without one is rebuilt with ./configure --enable-shared (pyenv: "
             "PYTHON_CONFIGURE_OPTS=--enable-shared pyenv install 3.11).",
             OLDEST_MINOR);
    return done;
}

static bool search(const char *resources, Text *tried) {
    text_add(tried, "no usable Python; tried in this order:");
    void *process = platform_loaded_python();
    if (process) return use_loaded(process, tried);
    text_add(tried, "\n  this process: no Python is loaded");
    char *library = platform_environment("FMU_LIBPYTHON");
    bool done = library ? use_library(library, tried) : use_interpreter(resources, tried);
    free(library);
    return done;
}

bool python_attach(const char *resources, Text *tried) {
    static atomic_bool attached = false;
    if (attached && py.Py_IsInitialized()) return true;
    ProcessLock lock;
    if (!process_lock(&lock, tried)) return false;
    if (!attached || !py.Py_IsInitialized()) attached = search(resources, tried);
    bool result = attached;
    process_unlock(&lock);
    return result;
}
