/* x' = u, y = x, and one thing wrong in one call, as other people's units do it. Which is said by the library's name,
 * FAULT_in_CALL, so that it can be wrong as early as while it is loaded; a library of another name is sound.
 *
 * The frame of the native units is included with its functions renamed, and each function that can go wrong calls its
 * own of the frame. A sound unit appends to the file that the environment's FAULTS_NOTES names when it is terminated
 * and freed. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fenv.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "fmi2Functions.h"
#include "fmi3Functions.h"

#undef fmi2Instantiate
#define fmi2Instantiate sound_fmi2Instantiate
#undef fmi2SetupExperiment
#define fmi2SetupExperiment sound_fmi2SetupExperiment
#undef fmi2EnterInitializationMode
#define fmi2EnterInitializationMode sound_fmi2EnterInitializationMode
#undef fmi2ExitInitializationMode
#define fmi2ExitInitializationMode sound_fmi2ExitInitializationMode
#undef fmi2SetReal
#define fmi2SetReal sound_fmi2SetReal
#undef fmi2GetReal
#define fmi2GetReal sound_fmi2GetReal
#undef fmi2DoStep
#define fmi2DoStep sound_fmi2DoStep
#undef fmi2GetFMUstate
#define fmi2GetFMUstate sound_fmi2GetFMUstate
#undef fmi2Terminate
#define fmi2Terminate sound_fmi2Terminate
#undef fmi2FreeInstance
#define fmi2FreeInstance sound_fmi2FreeInstance
#include "frame/fmi2.c"
#undef fmi2Instantiate
#undef fmi2SetupExperiment
#undef fmi2EnterInitializationMode
#undef fmi2ExitInitializationMode
#undef fmi2SetReal
#undef fmi2GetReal
#undef fmi2DoStep
#undef fmi2GetFMUstate
#undef fmi2Terminate
#undef fmi2FreeInstance
#undef REFERENCES
#undef ACCESS

#undef fmi3InstantiateCoSimulation
#define fmi3InstantiateCoSimulation sound_fmi3InstantiateCoSimulation
#undef fmi3EnterInitializationMode
#define fmi3EnterInitializationMode sound_fmi3EnterInitializationMode
#undef fmi3ExitInitializationMode
#define fmi3ExitInitializationMode sound_fmi3ExitInitializationMode
#undef fmi3SetFloat64
#define fmi3SetFloat64 sound_fmi3SetFloat64
#undef fmi3GetFloat64
#define fmi3GetFloat64 sound_fmi3GetFloat64
#undef fmi3GetBinary
#define fmi3GetBinary sound_fmi3GetBinary
#undef fmi3DoStep
#define fmi3DoStep sound_fmi3DoStep
#undef fmi3GetFMUState
#define fmi3GetFMUState sound_fmi3GetFMUState
#undef fmi3Terminate
#define fmi3Terminate sound_fmi3Terminate
#undef fmi3FreeInstance
#define fmi3FreeInstance sound_fmi3FreeInstance
#include "frame/fmi3.c"
#undef fmi3InstantiateCoSimulation
#undef fmi3EnterInitializationMode
#undef fmi3ExitInitializationMode
#undef fmi3SetFloat64
#undef fmi3GetFloat64
#undef fmi3GetBinary
#undef fmi3DoStep
#undef fmi3GetFMUState
#undef fmi3Terminate
#undef fmi3FreeInstance

typedef struct {
    double u, y;
    Bytes blob;
} Integrator;

static const Variable variables[] = {
    {"u", INPUT, REAL, offsetof(Integrator, u), .start = 1},
    {"y", OUTPUT, REAL, offsetof(Integrator, y)},
    {"blob", OUTPUT, BINARY, offsetof(Integrator, blob)},
};

static enum status integrate(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Integrator);
    self->y += h * self->u;
    return OK;
}

static const Model scalar = {"integrator", variables, 2, 0.1, 0, sizeof(Integrator), NULL, NULL, NULL, integrate};
static const Model with_blob = {"with_blob", variables, 3, 0.1, 0, sizeof(Integrator), NULL, NULL, NULL, integrate};
UNIT(scalar)
UNIT(with_blob)

static char fault[32] = "", call[32] = "";

/* Read what goes wrong out of the name of this library's file. */
static void read_name(void) {
    Dl_info here;
    if (!dladdr((void *)read_name, &here))
        return;
    const char *name = strrchr(here.dli_fname, '/');
    const char *in = strstr(name ? name : here.dli_fname, "_in_");
    if (!in || !name)
        return;
    snprintf(fault, sizeof fault, "%.*s", (int)(in - name - 1), name + 1);
    snprintf(call, sizeof call, "%.*s", (int)strcspn(in + 4, "."), in + 4);
}

static void note(Unit *unit, const char *what) {
    const char *file = getenv("FAULTS_NOTES");
    FILE *notes = file && !*fault ? fopen(file, "a") : NULL;
    if (!notes)
        return;
    fprintf(notes, "%s %s\n", unit->name, what);
    fclose(notes);
}

static bool is(const char *name) { return !strcmp(fault, name); }

static int deeper(volatile int n) {
    volatile char room[4096];
    room[n % 4096] = (char)n;
    return room[0] + deeper(n + 1) + room[n % 4096];
}

static void flood(Unit *unit) {
    for (int i = 0; i < 20000; i++)
        say(unit, OK, "line %d of very many", i);
}

static void log_huge(Unit *unit) {
    size_t n = 10000000;
    char *message = malloc(n);
    memset(message, 'x', n);
    message[n - 1] = 0;
    unit->log(unit, WARNING, message);
    free(message);
}

static void exhaust(void) {
    struct rlimit limit = {(rlim_t)8 << 30, (rlim_t)8 << 30};
    setrlimit(RLIMIT_AS, &limit);
    for (size_t n = (size_t)1 << 32; n > 64; n /= 2)
        while (malloc(n))
            ;
}

static volatile int *nowhere = NULL;
static volatile int zero = 0;
static volatile double quotient;
static bool is_copy;

/* Have this thread's floating-point unit send SIGFPE where a result is infinite or not a number. */
static void trap(void) { feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW); }

/* Do it, if it is to be wrong here; return the status to answer, -1 if the call goes on as usual. */
static int go_wrong(const char *where, Unit *unit) {
    if (!*fault || strcmp(call, where))
        return -1;
    if (is("crash"))
        *nowhere = 1;
    else if (is("divide"))
        return 1000 / zero;
    else if (is("abort"))
        abort();
    else if (is("exit"))
        exit(0);
    else if (is("leave"))
        _exit(0);
    else if (is("hang"))
        for (;;)
            sleep(1);
    else if (is("overflow"))
        return deeper(zero);
    else if (is("overrun"))
        for (volatile char *at = malloc(16);; at++)
            *at = 0x5a;
    else if (is("double_free")) {
        void *volatile block = malloc(3000), *volatile again = block;
        free(block);
        free(again);
    } else if (is("exhaust")) {
        exhaust();
        return ERROR;
    } else if (is("kill"))
        raise(SIGTERM);
    else if (is("chdir")) {
        if (chdir("/"))
            abort();
    } else if (is("close_low"))
        for (int i = 0; i < 256; i++)
            close(i);
    else if (is("close_any"))
        for (int i = 0; i < 1024; i++)
            close(i);
    else if (is("print"))
        puts("a unit's own words");
    else if (is("close_output"))
        close(1);
    else if (is("close_all"))
        for (int i = 3; i < 1024; i++)
            close(i);
    else if (is("handlers"))
        for (int i = 1; i < 32; i++)
            signal(i, SIG_IGN);
    else if (is("rounding"))
        fesetround(FE_UPWARD);
    else if (!strncmp(fault, "trap", 4)) {
        trap();
        if (is("trap_division"))
            quotient = 1.0 / (double)zero;
    } else if (is("fork")) {
        if (fork() == 0)
            _exit(9);
    } else if (is("duplicate")) {
        pid_t copy = fork(); /* both go on */
        if (copy == -1)
            abort();
        is_copy = copy == 0;
        usleep(1000);
    } else if (unit && is("error")) {
        say(unit, ERROR, "the solver failed");
        return ERROR;
    } else if (unit && is("fatal")) {
        say(unit, FATAL, "memory is corrupt");
        return FATAL;
    } else if (unit && is("discard"))
        return DISCARD;
    else if (unit && is("unknown"))
        return 77;
    else if (unit && is("negative"))
        return -2;
    else if (unit && is("flood"))
        flood(unit);
    else if (unit && is("log_null"))
        unit->log(unit, WARNING, NULL);
    else if (unit && is("log_bytes"))
        unit->log(unit, WARNING, "not UTF-8: \xff\xfe\x80");
    else if (unit && is("log_huge"))
        log_huge(unit);
    return -1;
}

__attribute__((constructor)) static void load(void) {
    read_name();
    go_wrong("load", NULL);
}
__attribute__((destructor)) static void unload(void) { go_wrong("unload", NULL); }

/* Answer Warning in place of OK, if it is to be so here: in this call, or in all. */
static int answer(const char *where, Unit *unit, int status) {
    if (status != OK || !is("warning") || (strcmp(call, where) && strcmp(call, "all")))
        return status;
    say(unit, WARNING, "%s: the step size was halved", where);
    return WARNING;
}

#define WRONG(where, c)                                                                                                \
    int wrong = go_wrong(where, c);                                                                                    \
    if (wrong != -1)                                                                                                   \
        return wrong;

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    Unit *unit = sound_fmi2Instantiate(name, type, guid, resources, functions, visible, logging);
    return go_wrong("instantiate", unit) == -1 ? unit : NULL;
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) {
    WRONG("setup", c)
    return answer("setup", c, sound_fmi2SetupExperiment(c, has_tolerance, tolerance, start, has_stop, stop));
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    WRONG("enter", c)
    return answer("enter", c, sound_fmi2EnterInitializationMode(c));
}
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    WRONG("exit", c)
    return answer("exit", c, sound_fmi2ExitInitializationMode(c));
}

/* A copy of the process writes a result again and again while the process itself goes on to later steps. */
static void write_late(double *result, double value) {
    for (int i = 0; is_copy && i < 2000; i++) {
        *(volatile double *)result = value;
        usleep(5);
    }
}

/* What goes wrong while it runs does so from 0.3 s on. */
static bool runs(Unit *unit) { return unit->kept->mode == STEP && unit->kept->time > 0.25; }

static int answer_running(const char *where, Unit *unit, bool running, int status) {
    return running ? answer(where, unit, status) : status;
}

static double spoilt(double y) {
    if (is("trap_infinity"))
        trap();
    return is("nan") ? NAN : is("infinity") || is("trap_infinity") ? INFINITY : y;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real values[]) {
    if (runs(c)) {
        WRONG("set", c)
    }
    return answer_running("set", c, runs(c), sound_fmi2SetReal(c, vr, n, values));
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real values[]) {
    if (runs(c)) {
        WRONG("get", c)
    }
    fmi2Status status = sound_fmi2GetReal(c, vr, n, values);
    for (size_t i = 0; i < n && runs(c) && !strcmp(call, "get"); i++)
        values[i] = spoilt(values[i]);
    write_late(values, -7.0);
    return answer_running("get", c, runs(c), status);
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_rollback) {
    bool running = runs(c);
    if (running) {
        WRONG("step", c)
    }
    return answer_running("step", c, running, sound_fmi2DoStep(c, t, h, no_rollback));
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (runs(c)) {
        WRONG("save", c)
    }
    return answer("save", c, sound_fmi2GetFMUstate(c, state));
}
fmi2Status fmi2Terminate(fmi2Component c) {
    WRONG("terminate", c)
    note(c, "terminated");
    return answer("terminate", c, sound_fmi2Terminate(c));
}
void fmi2FreeInstance(fmi2Component c) {
    go_wrong("free", c);
    note(c, "freed");
    sound_fmi2FreeInstance(c);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference required[], size_t n_required,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                         fmi3IntermediateUpdateCallback intermediate) {
    Unit *unit = sound_fmi3InstantiateCoSimulation(name, token, resources, visible, logging, event_mode, early_return,
                                                   required, n_required, environment, logger, intermediate);
    return go_wrong("instantiate", unit) == -1 ? unit : NULL;
}
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop) {
    WRONG("enter", c)
    return answer("enter", c, sound_fmi3EnterInitializationMode(c, has_tolerance, tolerance, start, has_stop, stop));
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    WRONG("exit", c)
    return answer("exit", c, sound_fmi3ExitInitializationMode(c));
}
fmi3Status fmi3SetFloat64(REFERENCES, const fmi3Float64 values[], size_t n_values) {
    if (runs(c)) {
        WRONG("set", c)
    }
    return answer_running("set", c, runs(c), sound_fmi3SetFloat64(c, vr, n, values, n_values));
}
fmi3Status fmi3GetFloat64(REFERENCES, fmi3Float64 values[], size_t n_values) {
    if (runs(c)) {
        WRONG("get", c)
    }
    fmi3Status status = sound_fmi3GetFloat64(c, vr, n, values, n_values);
    for (size_t i = 0; i < n_values && runs(c) && !strcmp(call, "get"); i++)
        values[i] = spoilt(values[i]);
    write_late(values, -7.0);
    return answer_running("get", c, runs(c), status);
}
fmi3Status fmi3GetBinary(REFERENCES, size_t sizes[], fmi3Binary values[], size_t n_values) {
    fmi3Status status = sound_fmi3GetBinary(c, vr, n, sizes, values, n_values);
    for (size_t i = 0; i < n && runs(c) && !strcmp(call, "binary"); i++) {
        values[i] = is("null") ? NULL : (fmi3Binary)0x1234;
        sizes[i] = is("too_long") ? (size_t)1 << 60 : 8;
    }
    return status;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_rollback, fmi3Boolean *event_needed,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last_time) {
    bool running = runs(c);
    if (running) {
        *event_needed = *terminate = *early = false;
        *last_time = t;
        WRONG("step", c)
    }
    int status = sound_fmi3DoStep(c, t, h, no_rollback, event_needed, terminate, early, last_time);
    write_late(last_time, t);
    return answer_running("step", c, running, status);
}
fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    if (runs(c)) {
        WRONG("save", c)
    }
    return answer("save", c, sound_fmi3GetFMUState(c, state));
}
fmi3Status fmi3Terminate(fmi3Instance c) {
    WRONG("terminate", c)
    note(c, "terminated");
    return answer("terminate", c, sound_fmi3Terminate(c));
}
void fmi3FreeInstance(fmi3Instance c) {
    go_wrong("free", c);
    note(c, "freed");
    sound_fmi3FreeInstance(c);
}
