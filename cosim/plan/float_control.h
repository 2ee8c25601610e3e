/* How this thread's floating-point unit rounds, traps and treats denormals: a unit may change it, and then all others
 * would compute with that. Reading it takes a nanosecond, where fegetenv takes many. */
#ifndef FLOAT_CONTROL_H
#define FLOAT_CONTROL_H

#include <stdint.h>

typedef uint64_t FloatControl;

#if defined(__x86_64__)

enum { EXCEPTION_FLAGS = 0x3f, ROUNDING_AT = 13, X87_DEFAULT = 0x37f, X87_ROUNDING_AT = 10 };

/* without the flags of what has happened, which every inexact operation sets */
static inline FloatControl float_control(void) {
    uint32_t mode;
    __asm__ volatile("stmxcsr %0" : "=m"(mode));
    return mode & ~(uint32_t)EXCEPTION_FLAGS;
}

static inline void set_float_control(FloatControl control) {
    uint32_t mode = (uint32_t)control;
    uint16_t x87 = (uint16_t)(X87_DEFAULT | (mode >> ROUNDING_AT & 3) << X87_ROUNDING_AT);
    __asm__ volatile("ldmxcsr %0" : : "m"(mode));
    __asm__ volatile("fldcw %0" : : "m"(x87));
}

#elif defined(__aarch64__)

static inline FloatControl float_control(void) {
    uint64_t mode;
    __asm__ volatile("mrs %0, fpcr" : "=r"(mode));
    return mode;
}

static inline void set_float_control(FloatControl control) { __asm__ volatile("msr fpcr, %0" : : "r"(control)); }

#else

static inline FloatControl float_control(void) { return 0; }
static inline void set_float_control(FloatControl control) {}

#endif
#endif
