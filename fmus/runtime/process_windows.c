#ifdef _WIN32
#include "process.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <wchar.h>
#include <windows.h>

#define PIPE_BUFFER 65536
#define LONGEST_COMMAND 32768 /* characters: CreateProcess's own limit */
#define ENVIRONMENT 32768     /* characters */

struct Process {
    HANDLE process, channel, done; /* `done` is the event of the transfer under way */
    HANDLE job;                    /* ends the process, and what it starts, with the host */
};

double process_clock(void) { return 1e-3 * (double)GetTickCount64(); }

/* Both ends of a channel: ours is read and written with a deadline, the other is inherited. */
static bool open_channel(HANDLE *ours, HANDLE *theirs) {
    static volatile LONG count = 0;
    wchar_t name[96];
    swprintf(name, sizeof name / sizeof *name, L"\\\\.\\pipe\\fmu-%lu-%p-%ld", GetCurrentProcessId(), (void *)&count,
             InterlockedIncrement(&count));
    *ours = CreateNamedPipeW(name, PIPE_ACCESS_DUPLEX | FILE_FLAG_OVERLAPPED | FILE_FLAG_FIRST_PIPE_INSTANCE,
                             PIPE_TYPE_BYTE | PIPE_WAIT | PIPE_REJECT_REMOTE_CLIENTS, 1, PIPE_BUFFER, PIPE_BUFFER, 0,
                             NULL);
    if (*ours == INVALID_HANDLE_VALUE) return false;
    SECURITY_ATTRIBUTES inherited = {.nLength = sizeof inherited, .bInheritHandle = TRUE};
    *theirs = CreateFileW(name, GENERIC_READ | GENERIC_WRITE, 0, &inherited, OPEN_EXISTING, 0, NULL);
    if (*theirs != INVALID_HANDLE_VALUE) return true;
    CloseHandle(*ours);
    return false;
}

/* Adds an argument by the rules of the C library that will read it. */
static void add_argument(Text *command, const char *argument) {
    text_add(command, command->length ? " \"" : "\"");
    for (const char *c = argument;; c++) {
        size_t backslashes = strspn(c, "\\");
        bool doubled = c[backslashes] == '"' || c[backslashes] == 0;
        for (size_t i = 0; i < (doubled ? 2 : 1) * backslashes; i++) text_add(command, "\\");
        c += backslashes;
        if (!*c) break;
        text_add(command, *c == '"' ? "\\%c" : "%c", *c);
    }
    text_add(command, "\"");
}

static wchar_t *command_line(const char *interpreter, const char *const arguments[], HANDLE channel, HANDLE memory) {
    Text command = {0}, numbers = {0};
    add_argument(&command, interpreter);
    for (; *arguments; arguments++) add_argument(&command, *arguments);
    text_add(&numbers, " %lu %llu %llu", GetCurrentProcessId(), (unsigned long long)(uintptr_t)channel,
             (unsigned long long)(uintptr_t)memory);
    text_add(&command, "%s", text_of(&numbers));
    wchar_t *line = calloc(LONGEST_COMMAND, sizeof *line);
    if (line && !MultiByteToWideChar(CP_UTF8, 0, text_of(&command), -1, line, LONGEST_COMMAND)) *line = 0;
    text_clear(&numbers);
    text_clear(&command);
    return line;
}

/* The environment of a bundled program: of the host's variables those that say where the system is and where the program
 * may write, in the order that Windows wants. All others could change what the unit computes. */
static wchar_t *bundled_environment(void) {
    const wchar_t *passed_on[] = {L"LOCALAPPDATA", L"SYSTEMROOT", L"TEMP", L"TMP", L"USERPROFILE"};
    wchar_t *block = calloc(ENVIRONMENT + 1, sizeof *block), *end = block; /* a full one ends with one more zero */
    for (size_t i = 0; block && i < sizeof passed_on / sizeof *passed_on; i++) {
        wchar_t *value = end + wcslen(passed_on[i]) + 1;
        if (value + 2 >= block + ENVIRONMENT) break;
        DWORD room = (DWORD)(block + ENVIRONMENT - value - 1), n = GetEnvironmentVariableW(passed_on[i], value, room);
        if (n == 0 || n >= room) continue;
        wcscpy(end, passed_on[i]);
        value[-1] = L'=';
        end = value + n + 1;
    }
    if (block) end[0] = end[1] = 0;
    return block;
}

/* `environment` NULL: the host's. */
static bool create(wchar_t *line, HANDLE handles[2], wchar_t *environment, PROCESS_INFORMATION *made) {
    SIZE_T size = 0;
    STARTUPINFOEXW startup = {.StartupInfo.cb = sizeof startup};
    InitializeProcThreadAttributeList(NULL, 1, 0, &size);
    startup.lpAttributeList = malloc(size);
    if (!startup.lpAttributeList) return false;
    bool created =
        InitializeProcThreadAttributeList(startup.lpAttributeList, 1, 0, &size) &&
        UpdateProcThreadAttribute(startup.lpAttributeList, 0, PROC_THREAD_ATTRIBUTE_HANDLE_LIST, handles,
                                  2 * sizeof *handles, NULL, NULL) &&
        CreateProcessW(NULL, line, NULL, NULL, TRUE,
                       EXTENDED_STARTUPINFO_PRESENT | CREATE_NO_WINDOW | CREATE_SUSPENDED | CREATE_NEW_PROCESS_GROUP |
                           CREATE_UNICODE_ENVIRONMENT,
                       environment, NULL, &startup.StartupInfo, made);
    DWORD why = GetLastError();
    DeleteProcThreadAttributeList(startup.lpAttributeList);
    free(startup.lpAttributeList);
    SetLastError(why);
    return created;
}

static HANDLE job_of(HANDLE process) {
    JOBOBJECT_EXTENDED_LIMIT_INFORMATION limits = {
        .BasicLimitInformation.LimitFlags = JOB_OBJECT_LIMIT_KILL_ON_JOB_CLOSE};
    HANDLE job = CreateJobObjectW(NULL, NULL);
    if (!job) return NULL;
    SetInformationJobObject(job, JobObjectExtendedLimitInformation, &limits, sizeof limits);
    AssignProcessToJobObject(job, process);
    return job;
}

static Process *start(const char *program, const char *const arguments[], const SharedMemory *memory,
                      wchar_t *environment, Text *fault) {
    HANDLE ours, theirs, shared = NULL;
    if (!open_channel(&ours, &theirs)) {
        text_add(fault, "no channel to it, code %lu", GetLastError());
        return NULL;
    }
    HANDLE here = GetCurrentProcess();
    DuplicateHandle(here, (HANDLE)memory->file, here, &shared, 0, TRUE, DUPLICATE_SAME_ACCESS);
    wchar_t *line = command_line(program, arguments, theirs, shared);
    PROCESS_INFORMATION made = {0};
    Process *process = calloc(1, sizeof *process);
    bool created = process && line && create(line, (HANDLE[]){theirs, shared}, environment, &made);
    if (!created) text_add(fault, "CreateProcess failed with code %lu", GetLastError());
    free(line);
    CloseHandle(theirs);
    if (shared) CloseHandle(shared);
    if (!created) {
        CloseHandle(ours);
        free(process);
        return NULL;
    }
    *process = (Process){.process = made.hProcess,
                         .channel = ours,
                         .done = CreateEventW(NULL, TRUE, FALSE, NULL),
                         .job = job_of(made.hProcess)};
    ResumeThread(made.hThread);
    CloseHandle(made.hThread);
    return process;
}

Process *process_start(const char *interpreter, const char *const arguments[], const SharedMemory *memory, Text *fault) {
    return start(interpreter, arguments, memory, NULL, fault);
}

Process *process_join(const char *program, const char *token, const char *const arguments[], const SharedMemory *memory,
                      Text *fault) {
    (void)token; /* each instance has a process of its own here */
    wchar_t *environment = bundled_environment();
    Process *process = environment ? start(program, arguments, memory, environment, fault) : NULL;
    free(environment);
    return process;
}

bool process_runs(const Process *process) { return WaitForSingleObject(process->process, 0) == WAIT_TIMEOUT; }

static Transfer transfer(Process *process, bool sends, char *bytes, size_t size, double deadline) {
    while (size > 0) {
        OVERLAPPED under_way = {.hEvent = process->done};
        DWORD part = size < PIPE_BUFFER ? (DWORD)size : PIPE_BUFFER, n = 0;
        BOOL begun = sends ? WriteFile(process->channel, bytes, part, NULL, &under_way)
                           : ReadFile(process->channel, bytes, part, NULL, &under_way);
        if (!begun && GetLastError() != ERROR_IO_PENDING) return ENDED;
        HANDLE either[] = {process->done, process->process};
        double left = ceil(1e3 * (deadline - process_clock()));
        DWORD limit = isinf(deadline) ? INFINITE : left > 0 ? (DWORD)fmin(left, 4e9) : 0;
        DWORD woken = WaitForMultipleObjects(2, either, FALSE, limit);
        if (woken != WAIT_OBJECT_0) CancelIoEx(process->channel, &under_way);
        bool done = GetOverlappedResult(process->channel, &under_way, &n, TRUE) && n > 0;
        if (!done) return woken == WAIT_TIMEOUT ? TOO_LATE : ENDED;
        bytes += n;
        size -= n;
    }
    return TRANSFERRED;
}

Transfer process_send(Process *process, const void *bytes, size_t size, double deadline) {
    return transfer(process, true, (char *)bytes, size, deadline); /* which then only reads them */
}

Transfer process_receive(Process *process, void *bytes, size_t size, double deadline) {
    return transfer(process, false, bytes, size, deadline);
}

static void describe(DWORD code, Text *how) {
    if (code == EXCEPTION_ACCESS_VIOLATION)
        text_add(how, "ended by an access violation; compiled code of a package has crashed");
    else
        text_add(how, code < 0x80000000 ? "ended with exit code %lu" : "ended with exit code 0x%lx", code);
}

int process_end(Process *process, double patience, Text *how) {
    DWORD code = 0;
    CloseHandle(process->channel);
    if (WaitForSingleObject(process->process, (DWORD)(1e3 * patience)) != WAIT_OBJECT_0) {
        TerminateProcess(process->process, 1);
        WaitForSingleObject(process->process, 5000);
    }
    GetExitCodeProcess(process->process, &code);
    describe(code, how);
    CloseHandle(process->done);
    CloseHandle(process->process);
    if (process->job) CloseHandle(process->job);
    free(process);
    return code < 256 ? (int)code : -1;
}

#endif
