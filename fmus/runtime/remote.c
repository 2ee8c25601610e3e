/* An instance's Python side in a process of its own, fmus/server.py: a failure there does not end
 * the host.
 *
 * Calls and their answers go through a channel; the variables' buffers lie in shared memory, so setting and getting
 * stay copies in memory. FMU_PYTHON is the path of the interpreter, else that of resources/python.txt is taken, else
 * `python3` on the PATH; a unit that brings its interpreter runs in that, and in no other. FMU_PYTHON_TIMEOUT is how long
 * a call may take, in seconds; 0 is without limit. Starting, which imports packages, may always take a minute.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "log.h"
#include "platform.h"
#include "process.h"
#include "python_api.h"
#include "side.h"
#include "variables.h"

#define TIMEOUT 300.0    /* s: for a call, if FMU_PYTHON_TIMEOUT is not set */
#define STARTING 60.0    /* s: at least, for starting */
#define GRACE_PERIOD 5.0 /* s: for ending by itself */
#define TOO_OLD 86       /* exit status, below */

/* The folder of the script must not be where modules are looked for; an old Python could not even read the script. */
#define BEGINNING                                                               \
    "import sys; del sys.path[0]; sys.version_info < (3, 10) and sys.exit(86);" \
    "import runpy; runpy.run_path(sys.argv[1], run_name='__main__')"

#define CURE_ENDED "Cure: reset the instance or set a saved state, which starts another process"

typedef struct {
    Process *process; /* NULL once it has ended */
    SharedMemory memory;
    char *interpreter, *resources, *token;
    double limit; /* s */
    bool bundled; /* the interpreter is the unit's own, of which one process serves all instances */
} Remote;

/* How calls and answers look in the channel; the numbers in them are fmus/server.py's, too. */
typedef struct {
    char method[32];
    int64_t index;  /* -1: none */
    uint64_t size;  /* of the bytes that follow */
    uint64_t given; /* whether bytes are an argument; there may be none of them */
} CallHead;

typedef struct {
    uint64_t outcome, size;
} AnswerHead;

typedef struct {
    uint64_t address, size, warning; /* the buffers' memory there; bytes of a warning that follows, then comes the table */
} Begun;

static const Side remote_side;

static Remote *side_of(const Instance *instance) { return instance->python; }

/* A call and its answer within `limit` seconds. `answer` is given; on TRANSFERRED its bytes are what the method
 * returned, or why not. */
static Transfer transfer(const Remote *side, const Question *question, double limit, Outcome *outcome,
                         Answer *answer) {
    double deadline = process_clock() + limit;
    CallHead call = {.index = question->index ? (int64_t)*question->index : -1,
                     .size = question->size,
                     .given = question->bytes != NULL};
    AnswerHead head;
    strncpy(call.method, question->method, sizeof call.method - 1);
    Transfer done = process_send(side->process, &call, sizeof call, deadline);
    if (done == TRANSFERRED) done = process_send(side->process, question->bytes, question->size, deadline);
    if (done == TRANSFERRED) done = process_receive(side->process, &head, sizeof head, deadline);
    if (done != TRANSFERRED) return done;
    if (head.outcome > RAISED || head.size >= SIZE_MAX) return ENDED; /* the block's code wrote into the channel */
    *outcome = (Outcome)head.outcome;
    *answer = (Answer){.bytes = malloc(head.size + 1), .size = head.size};
    if (!answer->bytes) return ENDED;
    answer->bytes[head.size] = 0;
    return process_receive(side->process, answer->bytes, head.size, deadline);
}

/* Ends a process that does not answer and adds how it ended; `cure` is what to do then, or nothing. */
static void lose(Remote *side, Transfer why, double limit, const char *cure, Text *text) {
    Text how = {0};
    int status = process_end(side->process, why == TOO_LATE ? 0.0 : GRACE_PERIOD, &how);
    side->process = NULL;
    if (why == TOO_LATE)
        text_add(text,
                 "the unit's Python process, %s, did not answer for %g s and was ended%s; a greater "
                 "FMU_PYTHON_TIMEOUT (s) gives it more time, 0 all the time it wants",
                 side->interpreter, limit, cure);
    else if (status == TOO_OLD)
        text_add(text, "it is older than Python 3.10");
    else
        text_add(text, "the unit's Python process, %s, %s%s", side->interpreter, text_of(&how), cure);
    text_clear(&how);
}

static Outcome ask(const Instance *instance, const char *function, const Question *question, Answer *answer) {
    Remote *side = side_of(instance);
    if (!side->process) {
        refuse(instance, function, "the unit's Python process has ended. " CURE_ENDED);
        return LOST;
    }
    Outcome outcome = LOST;
    Answer given = {0};
    Transfer done = transfer(side, question, side->limit, &outcome, &given);
    if (done != TRANSFERRED) {
        Text why = {0};
        lose(side, done, side->limit, ". " CURE_ENDED, &why);
        refuse(instance, function, "%s", text_of(&why));
        text_clear(&why);
        outcome = LOST;
    } else if (outcome != ANSWERED) {
        refuse(instance, function, "%s", given.bytes);
    } else if (answer) {
        *answer = given;
        return outcome;
    }
    free(given.bytes);
    return outcome;
}

static Outcome step(const Instance *instance, const char *function) {
    Question question = {.method = "step"};
    return ask(instance, function, &question, NULL);
}

/* Reads how a slave describes itself when it starts: a Begun, a warning, the table. */
static bool take_over(Instance *instance, const char *function, const Answer *answer, Text *fault) {
    SharedMemory *memory = &side_of(instance)->memory;
    Begun begun = {0};
    size_t size = answer->size;
    if (size >= sizeof begun) memcpy(&begun, answer->bytes, sizeof begun);
    if (size < sizeof begun || begun.warning > size - sizeof begun) {
        refuse(instance, function, "%zu bytes that tell of no unit; is resources/sources that of this unit?", size);
        return false;
    }
    const char *warning = answer->bytes + sizeof begun, *table = warning + begun.warning;
    if (begun.warning) warn(instance, function, "%.*s", (int)begun.warning, warning);
    if (!shared_memory_map(memory, begun.size, fault)) {
        refuse(instance, function, "%s", text_of(fault));
        return false;
    }
    uint64_t shift = (uint64_t)(uintptr_t)memory->address - begun.address;
    return take_table(instance, table, size - (size_t)(table - answer->bytes), shift);
}

/* Starts the interpreter and the slave in it. NO_PYTHON: the interpreter is of no use, `fault` says why. */
static Start begin(Instance *instance, const char *function, Text *fault) {
    Remote *side = side_of(instance);
    Text script = {0}, wanted = {0};
    text_add(&script, "%s/sources/handover/fmus/server.py", side->resources);
    const char *arguments[] = {"-E", "-u", "-X", "utf8", "-c", BEGINNING, text_of(&script), NULL};
    side->process = side->bundled ? process_join(side->interpreter, side->token, arguments + 6, &side->memory, fault)
                                  : process_start(side->interpreter, arguments, &side->memory, fault);
    text_clear(&script);
    if (!side->process) return NO_PYTHON;
    text_add(&wanted, "%s\n%s", side->token, side->resources);
    Question question = {.method = "start", .bytes = text_of(&wanted), .size = wanted.length};
    Answer answer = {0};
    Outcome outcome = LOST;
    double limit = fmax(side->limit, STARTING);
    Transfer done = transfer(side, &question, limit, &outcome, &answer);
    text_clear(&wanted);
    Start start = NOT_STARTED;
    if (done != TRANSFERRED) {
        const char *doubt = side->bundled ? "" : "; is it a Python 3.10 or later?";
        Text early = {0};
        if (done != TOO_LATE) text_add(&early, " before the unit had started%s", doubt);
        lose(side, done, limit, text_of(&early), fault);
        text_clear(&early);
        start = NO_PYTHON;
    } else if (outcome != ANSWERED) {
        refuse(instance, function, "%s", answer.bytes);
    } else if (take_over(instance, function, &answer, fault)) {
        start = STARTED;
    }
    free(answer.bytes);
    if (start != STARTED && side->process) {
        process_end(side->process, GRACE_PERIOD, fault);
        side->process = NULL;
    }
    return start;
}

static bool revive(Instance *instance, const char *function) {
    Remote *side = side_of(instance);
    if (side->process && process_runs(side->process)) return true;
    Text fault = {0};
    if (side->process) process_end(side->process, 0.0, &fault); /* nobody has asked it since it ended */
    text_clear(&fault);
    instance->mode = FAILED; /* whatever the mode was, that run is lost; the caller of the revival sets another */
    Start start = begin(instance, function, &fault);
    if (start == NO_PYTHON)
        refuse(instance, function,
               "%s does not start again: %s. Cure: once it can, reset the instance or set a saved state",
               side->interpreter, text_of(&fault));
    text_clear(&fault);
    return start == STARTED;
}

static void release(Instance *instance) {
    Remote *side = side_of(instance);
    Text how = {0};
    if (side->process) process_end(side->process, fmin(GRACE_PERIOD, side->limit), &how);
    text_clear(&how);
    shared_memory_close(&side->memory);
    free(side->interpreter);
    free(side->resources);
    free(side->token);
    free(side);
    instance->python = NULL;
}

static const Side remote_side = {.ask = ask, .step = step, .revive = revive, .release = release};

/* Decimal digits with at most one point, whatever the host's locale; -1 if it is something else. */
static double read_seconds(const char *string) {
    double value = 0.0, scale = 0.0;
    for (const char *c = string; *c; c++) {
        if (*c == '.' && scale == 0.0)
            scale = 1.0;
        else if (*c >= '0' && *c <= '9')
            value = 10.0 * value + (*c - '0'), scale *= 10.0;
        else
            return -1.0;
    }
    return scale > 0.0 ? value / scale : value;
}

static bool read_limit(const Instance *instance, const char *function, double *limit) {
    char *setting = platform_environment("FMU_PYTHON_TIMEOUT");
    *limit = !setting ? TIMEOUT : strcmp(setting, "inf") == 0 ? 0.0 : read_seconds(setting);
    if (!(*limit >= 0.0)) /* not even a number, with hundreds of decimals */
        refuse(instance, function, "FMU_PYTHON_TIMEOUT is '%s'; it is a number of seconds such as 2.5, or 0: no limit",
               setting);
    free(setting);
    if (*limit == 0.0) *limit = INFINITY;
    return *limit > 0.0;
}

/* Tries one interpreter; frees its path. */
static Start try(Instance *instance, const char *function, const char *from, char *interpreter, Text *tried) {
    if (!interpreter) {
        text_add(tried, "\n  %s: names no interpreter", from);
        return NO_PYTHON;
    }
    Text fault = {0};
    free(side_of(instance)->interpreter);
    side_of(instance)->interpreter = interpreter;
    Start start = begin(instance, function, &fault);
    if (start == NO_PYTHON) text_add(tried, "\n  %s: %s: %s", from, interpreter, text_of(&fault));
    text_clear(&fault);
    return start;
}

static bool readable(const Instance *instance, const char *function, const char *resources, const char *source) {
    Text path = {0};
    text_add(&path, "%s/sources/handover/fmus/%s", resources, source);
    bool there = platform_exists(text_of(&path));
    if (!there) refuse_unreadable(instance, function, text_of(&path));
    text_clear(&path);
    return there;
}

static Start search(Instance *instance, const char *function, Text *tried) {
    char *chosen = platform_environment("FMU_PYTHON");
    if (chosen) return try(instance, function, "FMU_PYTHON", chosen, tried);
    text_add(tried, "\n  FMU_PYTHON: not set");
    char *noted = python_noted(side_of(instance)->resources);
    Start start = try(instance, function, "resources/python.txt", noted, tried);
    if (start == NO_PYTHON) start = try(instance, function, PYTHON_ON_PATH " on the PATH", copy_of(PYTHON_ON_PATH), tried);
    return start;
}

/* Makes an instance's side, without a process yet; false is in the log. */
static bool prepare(Instance *instance, const char *function, const char *resources, const char *token) {
    Remote *side = calloc(1, sizeof *side);
    if (!side) return false;
    *side = (Remote){.memory = NO_SHARED_MEMORY, .resources = copy_of(resources), .token = copy_of(token)};
    instance->python = side;
    instance->side = &remote_side;
    return read_limit(instance, function, &side->limit) && readable(instance, function, resources, "server.py") &&
           readable(instance, function, resources, "loader.py");
}

Start remote_start(Instance *instance, const char *function, const char *resources, const char *token, Text *tried) {
    bool is_last_resort = tried->length > 0;
    if (!prepare(instance, function, resources, token)) return NOT_STARTED;
    Remote *side = side_of(instance);
    Text apart = {0};
    Start start = NO_PYTHON;
    if (shared_memory_open(&side->memory, &apart)) start = search(instance, function, &apart);
    if (start == STARTED && is_last_resort)
        warn(instance, function,
             "%s\nSo the unit runs in a Python process of its own, %s; its steps take longer. "
             "FMU_PYTHON_PROCESS = 1 asks for that without this warning, 0 forbids it.",
             text_of(tried), side->interpreter);
    text_add(tried, "%s of its own; tried in this order:%s",
             is_last_resort ? "\nNor is there a Python for a process" : "no usable Python for a process", text_of(&apart));
    text_add(tried, "\nCure: set the environment variable FMU_PYTHON to the interpreter of a Python 3.10 or later that "
                    "has the packages of this unit, such as /usr/bin/python3.");
    text_clear(&apart);
    return start;
}

Start bundled_start(Instance *instance, const char *function, const char *resources, const char *token,
                    const char *program, Text *tried) {
    if (!prepare(instance, function, resources, token)) return NOT_STARTED;
    Remote *side = side_of(instance);
    side->bundled = true;
    Text apart = {0};
    Start start = NO_PYTHON;
    if (shared_memory_open(&side->memory, &apart))
        start = try(instance, function, "the interpreter in the FMU", copy_of(program), &apart);
    text_add(tried, "the unit brings its own interpreter, which does not start, and no other is tried:%s\nCure: unpack "
                    "the FMU again, into an empty folder where programs may be executed.", text_of(&apart));
    text_clear(&apart);
    return start;
}
