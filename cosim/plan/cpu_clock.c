#define _POSIX_C_SOURCE 199309L

#include "cpu_clock.h"

#ifdef _WIN32
#include <stdint.h>
#include <windows.h>

static double seconds(FILETIME t) { return ((uint64_t)t.dwHighDateTime << 32 | t.dwLowDateTime) * 1e-7; }

double cpu_clock(void) {
    FILETIME created, exited, kernel, user;
    GetProcessTimes(GetCurrentProcess(), &created, &exited, &kernel, &user);
    return seconds(kernel) + seconds(user);
}
#else
#include <time.h>

double cpu_clock(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}
#endif
