/* An instance's Python side in the host's process. Every call takes and releases the interpreter's lock. */
#include <stdlib.h>
#include <string.h>

#include "log.h"
#include "platform.h"
#include "python_api.h"
#include "side.h"
#include "variables.h"

#define FILE_INPUT 257 /* Py_file_input */

typedef struct {
    PyObject *slave, *step, *explain;
} Embedded;

static const Side embedded;

static Embedded *side_of(const Instance *instance) { return instance->python; }

static void drop(PyObject *object) {
    if (object) py.Py_DecRef(object);
}

/* Adds a Python string; drops it. */
static void add_string(Text *text, PyObject *string) {
    PyObject *bytes = string ? py.PyUnicode_AsUTF8String(string) : NULL;
    char *chars;
    Py_ssize_t size;
    if (bytes && py.PyBytes_AsStringAndSize(bytes, &chars, &size) == 0) text_add(text, "%.*s", (int)size, chars);
    drop(bytes);
    drop(string);
    py.PyErr_Clear();
}

/* Whether an exception says that nothing has changed. */
static bool is_refusal(PyObject *error) {
    PyObject *mark = error ? py.PyObject_GetAttrString(error, "is_refusal") : NULL;
    bool is = mark && py.PyObject_IsTrue(mark) == 1;
    drop(mark);
    py.PyErr_Clear();
    return is;
}

/* Logs the exception that is set and clears it; returns whether it rejects the call. */
static bool log_exception(const Instance *instance, const char *function) {
    PyObject *type = NULL, *error = NULL, *trace = NULL;
    py.PyErr_Fetch(&type, &error, &trace);
    py.PyErr_NormalizeException(&type, &error, &trace);
    if (error && trace) py.PyException_SetTraceback(error, trace);
    Text text = {0};
    PyObject *explain = side_of(instance)->explain;
    if (error && explain) add_string(&text, py.PyObject_CallFunctionObjArgs(explain, error, NULL));
    if (!text.length && type) {
        add_string(&text, py.PyObject_GetAttrString(type, "__name__"));
        text_add(&text, ": ");
        if (error) add_string(&text, py.PyObject_Str(error));
    }
    bool refused = is_refusal(error);
    drop(type);
    drop(error);
    drop(trace);
    py.PyErr_Clear();
    refuse(instance, function, "%s", text_of(&text));
    text_clear(&text);
    return refused;
}

/* Calls a method with up to two arguments, which it drops. */
static PyObject *invoke(const Instance *instance, const char *method, PyObject *first, PyObject *second) {
    PyObject *bound = py.PyObject_GetAttrString(side_of(instance)->slave, method);
    PyObject *result = bound ? py.PyObject_CallFunctionObjArgs(bound, first, second, NULL) : NULL;
    drop(bound);
    drop(first);
    drop(second);
    return result;
}

#define READY "loader is complete"

/* The global names of a loader of this source: instances share them, else each would leave garbage for the collector. */
static PyObject *loader_names(const char *source) {
    uint64_t digest = 0xcbf29ce484222325u; /* FNV-1a */
    for (const char *at = source; *at; at++) digest = (digest ^ (unsigned char)*at) * 0x100000001b3u;
    Text name = {0};
    text_add(&name, "_fmu_loader_%016llx", (unsigned long long)digest);
    PyObject *module = py.PyImport_AddModule(text_of(&name));
    PyObject *names = module ? py.PyModule_GetDict(module) : NULL;
    PyObject *builtins = py.PyImport_AddModule("builtins"); /* C code that imports looks for it in these names */
    text_clear(&name);
    if (!names || !builtins || py.PyDict_SetItemString(names, "__builtins__", builtins) != 0) return NULL;
    py.Py_IncRef(names);
    return names;
}

/* Runs the loader's source, unless an earlier instance has, and returns its global names. */
static PyObject *run_loader(const Instance *instance, const char *function, const char *resources) {
    Text path = {0};
    text_add(&path, "%s/sources/handover/fmus/loader.py", resources);
    char *source = platform_read_file(text_of(&path));
    PyObject *names = source ? loader_names(source) : NULL;
    if (!source)
        refuse_unreadable(instance, function, text_of(&path));
    else if (!names)
        log_exception(instance, function);
    if (names && !py.PyDict_GetItemString(names, READY)) {
        PyObject *code = py.Py_CompileString(source, text_of(&path), FILE_INPUT);
        PyObject *done = code ? py.PyEval_EvalCode(code, names, names) : NULL;
        if (done) {
            py.PyDict_SetItemString(names, READY, done);
        } else {
            log_exception(instance, function);
            drop(names);
            names = NULL;
        }
        drop(done);
        drop(code);
    }
    free(source);
    text_clear(&path);
    return names;
}

static PyObject *item(PyObject *dictionary, const char *name) {
    PyObject *found = py.PyDict_GetItemString(dictionary, name);
    if (found) py.Py_IncRef(found);
    return found;
}

/* Takes the bytes that a method returned; if they are none or there is no memory, a Python exception is set. */
static bool take(PyObject *result, Answer *answer) {
    char *chars;
    Py_ssize_t size;
    if (py.PyBytes_AsStringAndSize(result, &chars, &size) != 0) return false;
    *answer = (Answer){.bytes = malloc((size_t)size + 1), .size = (size_t)size};
    if (!answer->bytes) {
        py.PyErr_NoMemory();
        return false;
    }
    memcpy(answer->bytes, chars, (size_t)size + 1); /* Python ends its bytes with a NUL, too */
    return true;
}

/* A host that is Python's own may end it while instances live; what is called then would crash. */
static bool running(const Instance *instance, const char *function) {
    if (py.Py_IsInitialized()) return true;
    refuse(instance, function,
           "the host has ended its Python while this instance lives. Cure: free instances first, then end Python");
    return false;
}

static Outcome outcome_of(const Instance *instance, const char *function, PyObject *result) {
    if (result) return ANSWERED;
    return log_exception(instance, function) ? REFUSED : RAISED;
}

static Outcome ask(const Instance *instance, const char *function, const Question *question, Answer *answer) {
    if (!running(instance, function)) return LOST;
    int lock = py.PyGILState_Ensure();
    PyObject *index = question->index ? py.PyLong_FromSize_t(*question->index) : NULL;
    PyObject *bytes =
        question->bytes ? py.PyBytes_FromStringAndSize(question->bytes, (Py_ssize_t)question->size) : NULL;
    PyObject *result = invoke(instance, question->method, index ? index : bytes, index ? bytes : NULL);
    Outcome outcome = outcome_of(instance, function, result);
    if (result && answer && !take(result, answer)) {
        log_exception(instance, function);
        outcome = RAISED;
    }
    drop(result);
    py.PyGILState_Release(lock);
    return outcome;
}

static Outcome step(const Instance *instance, const char *function) {
    if (!running(instance, function)) return LOST;
    int lock = py.PyGILState_Ensure();
    PyObject *result = py.PyObject_CallNoArgs(side_of(instance)->step);
    Outcome outcome = outcome_of(instance, function, result);
    drop(result);
    py.PyGILState_Release(lock);
    return outcome;
}

static bool revive(Instance *instance, const char *function) { return running(instance, function); }

static void release(Instance *instance) {
    Embedded *side = side_of(instance);
    if (py.Py_IsInitialized()) { /* the host's Python may have ended */
        int lock = py.PyGILState_Ensure();
        drop(side->step);
        drop(side->slave);
        drop(side->explain);
        py.PyGILState_Release(lock);
    }
    free(side);
    instance->python = NULL;
}

static const Side embedded = {.ask = ask, .step = step, .revive = revive, .release = release};

/* Logs what the loader has to say about an instance that it started. */
static void warn_of(const Instance *instance, const char *function, PyObject *loader, PyObject *folder) {
    PyObject *warning = item(loader, "warning");
    Text text = {0};
    if (warning) add_string(&text, py.PyObject_CallFunctionObjArgs(warning, folder, NULL));
    if (text.length) warn(instance, function, "%s", text_of(&text));
    text_clear(&text);
    drop(warning);
}

static bool fetch_table(Instance *instance) {
    PyObject *bytes = invoke(instance, "table", NULL, NULL);
    Answer table = {0};
    bool taken = bytes && take(bytes, &table) && take_table(instance, table.bytes, table.size, 0);
    free(table.bytes);
    drop(bytes);
    return taken;
}

static bool begin(Instance *instance, const char *function, const char *resources, const char *token) {
    PyObject *loader = run_loader(instance, function, resources);
    if (!loader) return false;
    Embedded *side = side_of(instance);
    side->explain = item(loader, "explain");
    PyObject *start = item(loader, "start");
    PyObject *folder = py.PyUnicode_FromString(resources);
    PyObject *wanted = py.PyUnicode_FromString(token);
    if (start && folder && wanted) side->slave = py.PyObject_CallFunctionObjArgs(start, folder, wanted, NULL);
    side->step = side->slave ? py.PyObject_GetAttrString(side->slave, "step") : NULL;
    bool begun = side->step && fetch_table(instance);
    if (begun)
        warn_of(instance, function, loader, folder);
    else
        log_exception(instance, function);
    drop(start);
    drop(folder);
    drop(wanted);
    drop(loader);
    return begun;
}

Start embedded_start(Instance *instance, const char *function, const char *resources, const char *token, Text *tried) {
    if (!python_attach(resources, tried)) return NO_PYTHON;
    instance->python = calloc(1, sizeof(Embedded));
    if (!instance->python) return NOT_STARTED;
    instance->side = &embedded;
    int lock = py.PyGILState_Ensure();
    bool begun = begin(instance, function, resources, token);
    py.PyGILState_Release(lock);
    return begun ? STARTED : NOT_STARTED;
}
