/* The Python side of an instance: fmus/loader.py starts it, fmus/slave.py is what is called. */
#include <stdlib.h>
#include <string.h>

#include "bundled.h"
#include "log.h"
#include "platform.h"
#include "side.h"
#include "slave.h"

/* In which ways the interpreter may run, by FMU_PYTHON_PROCESS. */
static bool read_ways(const Instance *instance, const char *function, bool *here, bool *apart) {
    char *setting = platform_environment("FMU_PYTHON_PROCESS");
    *here = !setting || strcmp(setting, "0") == 0;
    *apart = !setting || strcmp(setting, "1") == 0;
    if (!*here && !*apart)
        refuse(instance, function,
               "FMU_PYTHON_PROCESS is '%s'; it is 1 (Python in a process of its own), 0 (never), or not set", setting);
    free(setting);
    return *here || *apart;
}

/* Whether the user chose a library and no interpreter: then Python is that one or none. */
static bool only_a_library_is_chosen(void) {
    char *library = platform_environment("FMU_LIBPYTHON"), *interpreter = platform_environment("FMU_PYTHON");
    bool only = library && !interpreter;
    free(library);
    free(interpreter);
    return only;
}

/* Starts a unit that brings its interpreter: whatever the environment says of other ones. */
static Start start_bundled(Instance *instance, const char *function, const char *resources, const char *token,
                           bool *is_bundled) {
    Text tried = {0};
    char *program;
    Start start = NO_PYTHON;
    Bundle bundled = bundled_interpreter(resources, &program, &tried);
    *is_bundled = bundled != NO_BUNDLE;
    if (bundled == BUNDLED) start = bundled_start(instance, function, resources, token, program, &tried);
    if (*is_bundled && start == NO_PYTHON) refuse(instance, function, "%s", text_of(&tried));
    free(program);
    text_clear(&tried);
    return start;
}

bool slave_start(Instance *instance, const char *function, const char *resources, const char *token) {
    bool here, apart, is_bundled;
    Start own = start_bundled(instance, function, resources, token, &is_bundled);
    if (is_bundled) return own == STARTED;
    if (!read_ways(instance, function, &here, &apart)) return false;
    Text tried = {0};
    Start start = NO_PYTHON;
    if (here) start = embedded_start(instance, function, resources, token, &tried);
    bool is_last_resort = here && apart;
    if (start == NO_PYTHON && is_last_resort && only_a_library_is_chosen())
        text_add(&tried, "\nNor is a process of its own tried while FMU_LIBPYTHON is set, unless FMU_PYTHON is set or "
                         "FMU_PYTHON_PROCESS is 1.");
    else if (start == NO_PYTHON && apart)
        start = remote_start(instance, function, resources, token, &tried);
    if (start == NO_PYTHON) refuse(instance, function, "%s", text_of(&tried));
    text_clear(&tried);
    return start == STARTED;
}

void slave_release(Instance *instance) {
    if (instance->python) instance->side->release(instance);
    for (size_t i = 0; i < instance->n_strings; i++) free(instance->strings[i]);
    free(instance->strings);
}

bool slave_revive(Instance *instance, const char *function) { return instance->side->revive(instance, function); }

/* The status of a call that leaves the block as it was if it fails. */
static Status status_of(Instance *instance, Outcome outcome) {
    if (outcome == LOST) instance->mode = FAILED;
    return outcome == ANSWERED ? STATUS_OK : STATUS_ERROR;
}

/* The same after a call that may have changed half of the block's state: only a rejected call keeps the mode. */
static Status changed(Instance *instance, Outcome outcome) {
    if (outcome == RAISED) instance->mode = FAILED;
    return status_of(instance, outcome);
}

Status slave_call(Instance *instance, const char *function, const char *method) {
    Question question = {.method = method};
    return changed(instance, instance->side->ask(instance, function, &question, NULL));
}

Status slave_step(Instance *instance, const char *function) {
    return changed(instance, instance->side->step(instance, function));
}

Status slave_get_state(Instance *instance, const char *function, char **bytes, size_t *size) {
    Question question = {.method = "get_state"};
    Answer answer = {0};
    Status status = status_of(instance, instance->side->ask(instance, function, &question, &answer));
    *bytes = answer.bytes;
    *size = answer.size;
    return status;
}

Status slave_set_state(Instance *instance, const char *function, const char *bytes, size_t size) {
    if (!slave_revive(instance, function)) return STATUS_ERROR;
    Question question = {.method = "set_state", .bytes = bytes, .size = size};
    return changed(instance, instance->side->ask(instance, function, &question, NULL));
}

/* Where the string last read from a variable is kept for the host. */
static char **kept_string(Instance *instance, size_t index) {
    if (index >= instance->n_strings) {
        char **more = realloc(instance->strings, (index + 1) * sizeof *more);
        if (!more) return NULL;
        for (size_t i = instance->n_strings; i <= index; i++) more[i] = NULL;
        instance->strings = more;
        instance->n_strings = index + 1;
    }
    return &instance->strings[index];
}

Status slave_derivative(Instance *instance, const char *function, const double seed[], double sensitivity[]) {
    Question question = {.method = "derivative", .bytes = (const char *)seed, .size = instance->n_inputs * sizeof *seed};
    Answer answer = {0};
    Status status = status_of(instance, instance->side->ask(instance, function, &question, &answer));
    size_t size = instance->n_outputs * sizeof *sensitivity;
    if (status == STATUS_OK && answer.size != size)
        status = refuse(instance, function, "%zu bytes of derivatives where there are to be %zu", answer.size, size);
    if (status == STATUS_OK) memcpy(sensitivity, answer.bytes, size);
    free(answer.bytes);
    return status;
}

Status slave_get_string(Instance *instance, const char *function, size_t index, const char **value) {
    Question question = {.method = "get_string", .index = &index};
    Answer answer = {0};
    Status status = status_of(instance, instance->side->ask(instance, function, &question, &answer));
    if (status != STATUS_OK) return status;
    char **kept = kept_string(instance, index);
    if (!kept) {
        free(answer.bytes);
        return refuse(instance, function, "no memory for a string of %zu bytes", answer.size);
    }
    if (*kept && strcmp(*kept, answer.bytes) == 0) { /* one call may ask for it twice and then has two pointers to it */
        free(answer.bytes);
    } else {
        free(*kept);
        *kept = answer.bytes;
    }
    *value = *kept;
    return STATUS_OK;
}

Status slave_set_string(Instance *instance, const char *function, size_t index, const char *value) {
    Question question = {.method = "set_string", .index = &index, .bytes = value, .size = strlen(value)};
    return status_of(instance, instance->side->ask(instance, function, &question, NULL));
}
