/* The Python side of an instance: fmus/loader.py starts it, fmus/slave.py is what is called. */
#include <stdlib.h>
#include <string.h>

#include "instance.h"
#include "platform.h"

#define FILE_INPUT 257 /* Py_file_input */

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

/* Logs the exception that is set and clears it; tells whether it is a refusal. */
static bool log_exception(const Instance *instance, const char *function) {
    PyObject *type = NULL, *error = NULL, *trace = NULL;
    py.PyErr_Fetch(&type, &error, &trace);
    py.PyErr_NormalizeException(&type, &error, &trace);
    if (error && trace) py.PyException_SetTraceback(error, trace);
    Text text = {0};
    if (error && instance->explain) add_string(&text, py.PyObject_CallFunctionObjArgs(instance->explain, error, NULL));
    if (!text.length && type) {
        add_string(&text, py.PyObject_Str(type));
        text_add(&text, " ");
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

static Status refuse_exception(const Instance *instance, const char *function) {
    log_exception(instance, function);
    return STATUS_ERROR;
}

/* The same after a call that may have left the block's state half changed: only a refusal leaves the mode as it is. */
static Status fail_by_exception(Instance *instance, const char *function) {
    if (!log_exception(instance, function)) instance->mode = FAILED;
    return STATUS_ERROR;
}

/* Calls a method with up to two arguments, which it drops. */
static PyObject *invoke(const Instance *instance, const char *method, PyObject *first, PyObject *second) {
    PyObject *bound = py.PyObject_GetAttrString(instance->slave, method);
    PyObject *result = bound ? py.PyObject_CallFunctionObjArgs(bound, first, second, NULL) : NULL;
    drop(bound);
    drop(first);
    drop(second);
    return result;
}

#define READY "loader is complete"

/* The global names of a loader of this source: instances share them, or each would leave garbage for the collector. */
static PyObject *loader_names(const char *source) {
    uint64_t digest = 0xcbf29ce484222325u; /* FNV-1a */
    for (const char *at = source; *at; at++) digest = (digest ^ (unsigned char)*at) * 0x100000001b3u;
    Text name = {0};
    text_add(&name, "_fmu_loader_%016llx", (unsigned long long)digest);
    PyObject *module = py.PyImport_AddModule(text_of(&name));
    PyObject *names = module ? py.PyModule_GetDict(module) : NULL;
    if (names) py.Py_IncRef(names);
    text_clear(&name);
    return names;
}

/* Runs the loader's source, unless an earlier instance has, and returns its global names. */
static PyObject *run_loader(const Instance *instance, const char *function, const char *resources) {
    Text path = {0};
    text_add(&path, "%s/sources/fmus/loader.py", resources);
    char *source = platform_read_file(text_of(&path));
    PyObject *names = source ? loader_names(source) : NULL;
    if (!source) refuse(instance, function, "%s cannot be read; is the resource location right?", text_of(&path));
    if (names && !py.PyDict_GetItemString(names, READY)) {
        PyObject *code = py.Py_CompileString(source, text_of(&path), FILE_INPUT);
        PyObject *done = code ? py.PyEval_EvalCode(code, names, names) : NULL;
        if (done) {
            py.PyDict_SetItemString(names, READY, done);
        } else {
            refuse_exception(instance, function);
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

/* Takes over the table that describes the buffers. */
static bool take_table(Instance *instance) {
    PyObject *bytes = invoke(instance, "table", NULL, NULL);
    char *chars;
    Py_ssize_t size;
    TableHeader header;
    bool fits = bytes && py.PyBytes_AsStringAndSize(bytes, &chars, &size) == 0;
    instance->table = fits ? malloc((size_t)size) : NULL;
    if (instance->table) {
        memcpy(instance->table, chars, (size_t)size);
        memcpy(&header, chars, sizeof header);
    }
    drop(bytes);
    if (!instance->table) return false;
    instance->binaries = (const BinaryBuffer *)(instance->table + sizeof header);
    instance->variables = (const Variable *)(instance->binaries + header.binaries);
    instance->n_variables = header.variables;
    instance->names = (const char *)(instance->variables + header.variables);
    instance->floats = (double *)(uintptr_t)header.floats;
    instance->integers = (int64_t *)(uintptr_t)header.integers;
    instance->booleans = (uint8_t *)(uintptr_t)header.booleans;
    instance->sizes = (uint64_t *)(uintptr_t)header.sizes;
    instance->first_input = header.first_input;
    instance->n_inputs = header.inputs;
    instance->first_output = header.first_output;
    instance->n_outputs = header.outputs;
    instance->abilities = header.abilities;
    instance->period_counter = header.period_counter;
    instance->period_resolution = header.period_resolution;
    return true;
}

/* Logs what the loader has to say about an instance that it started. */
static void warn_of(const Instance *instance, const char *function, PyObject *loader, PyObject *folder) {
    PyObject *warning = item(loader, "warning");
    Text text = {0};
    if (warning) add_string(&text, py.PyObject_CallFunctionObjArgs(warning, folder, NULL));
    if (text.length) warn(instance, function, "%s", text_of(&text));
    text_clear(&text);
    drop(warning);
}

bool slave_start(Instance *instance, const char *function, const char *resources, const char *token) {
    Text tried = {0};
    bool attached = python_attach(resources, &tried);
    if (!attached) refuse(instance, function, "%s", text_of(&tried));
    text_clear(&tried);
    if (!attached) return false;
    int lock = py.PyGILState_Ensure();
    PyObject *loader = run_loader(instance, function, resources);
    bool started = false;
    if (loader) {
        instance->explain = item(loader, "explain");
        PyObject *begin = item(loader, "start");
        PyObject *folder = py.PyUnicode_FromString(resources);
        PyObject *wanted = py.PyUnicode_FromString(token);
        if (begin && folder && wanted)
            instance->slave = py.PyObject_CallFunctionObjArgs(begin, folder, wanted, NULL);
        instance->step = instance->slave ? py.PyObject_GetAttrString(instance->slave, "step") : NULL;
        started = instance->step && take_table(instance);
        if (started)
            warn_of(instance, function, loader, folder);
        else
            refuse_exception(instance, function);
        drop(begin);
        drop(folder);
        drop(wanted);
        drop(loader);
    }
    py.PyGILState_Release(lock);
    return started;
}

void slave_release(Instance *instance) {
    if (!instance->slave && !instance->explain) return; /* never attached */
    if (!py.Py_IsInitialized()) return;                 /* the host's Python has ended */
    int lock = py.PyGILState_Ensure();
    drop(instance->step);
    drop(instance->slave);
    drop(instance->explain);
    py.PyGILState_Release(lock);
}

Status slave_call(Instance *instance, const char *function, const char *method) {
    int lock = py.PyGILState_Ensure();
    PyObject *result = invoke(instance, method, NULL, NULL);
    Status status = result ? STATUS_OK : fail_by_exception(instance, function);
    drop(result);
    py.PyGILState_Release(lock);
    return status;
}

Status slave_step(Instance *instance, const char *function) {
    int lock = py.PyGILState_Ensure();
    PyObject *result = py.PyObject_CallNoArgs(instance->step);
    Status status = result ? STATUS_OK : fail_by_exception(instance, function);
    drop(result);
    py.PyGILState_Release(lock);
    return status;
}

Status slave_get_state(Instance *instance, const char *function, char **bytes, size_t *size) {
    int lock = py.PyGILState_Ensure();
    PyObject *state = invoke(instance, "get_state", NULL, NULL);
    char *chars;
    Py_ssize_t n;
    Status status = STATUS_OK;
    if (state && py.PyBytes_AsStringAndSize(state, &chars, &n) == 0) {
        *size = (size_t)n;
        *bytes = malloc(*size ? *size : 1);
        if (*bytes)
            memcpy(*bytes, chars, *size);
        else
            status = refuse(instance, function, "no memory for a state of %zu bytes", *size);
    } else {
        status = refuse_exception(instance, function);
    }
    drop(state);
    py.PyGILState_Release(lock);
    return status;
}

Status slave_set_state(Instance *instance, const char *function, const char *bytes, size_t size) {
    int lock = py.PyGILState_Ensure();
    PyObject *state = py.PyBytes_FromStringAndSize(bytes, (Py_ssize_t)size);
    PyObject *result = state ? invoke(instance, "set_state", state, NULL) : NULL;
    Status status = result ? STATUS_OK : fail_by_exception(instance, function);
    drop(result);
    py.PyGILState_Release(lock);
    return status;
}

Status slave_derivative(Instance *instance, const char *function, const double seed[], double sensitivity[]) {
    int lock = py.PyGILState_Ensure();
    PyObject *given = py.PyBytes_FromStringAndSize((const char *)seed, (Py_ssize_t)(instance->n_inputs * sizeof *seed));
    PyObject *bytes = given ? invoke(instance, "derivative", given, NULL) : NULL;
    char *chars;
    Py_ssize_t size;
    Status status = STATUS_OK;
    if (bytes && py.PyBytes_AsStringAndSize(bytes, &chars, &size) == 0)
        memcpy(sensitivity, chars, instance->n_outputs * sizeof *sensitivity);
    else
        status = refuse_exception(instance, function);
    drop(bytes);
    py.PyGILState_Release(lock);
    return status;
}

Status slave_get_string(Instance *instance, const char *function, size_t index, const char **value) {
    int lock = py.PyGILState_Ensure();
    PyObject *bytes = invoke(instance, "get_string", py.PyLong_FromSize_t(index), NULL);
    char *chars;
    Py_ssize_t size;
    Status status = STATUS_OK;
    if (bytes && py.PyBytes_AsStringAndSize(bytes, &chars, &size) == 0)
        *value = chars; /* the slave keeps these bytes until the variable changes */
    else
        status = refuse_exception(instance, function);
    drop(bytes);
    py.PyGILState_Release(lock);
    return status;
}

Status slave_set_string(Instance *instance, const char *function, size_t index, const char *value) {
    int lock = py.PyGILState_Ensure();
    PyObject *bytes = py.PyBytes_FromStringAndSize(value, (Py_ssize_t)strlen(value));
    PyObject *result = bytes ? invoke(instance, "set_string", py.PyLong_FromSize_t(index), bytes) : NULL;
    Status status = result ? STATUS_OK : refuse_exception(instance, function);
    drop(result);
    py.PyGILState_Release(lock);
    return status;
}
