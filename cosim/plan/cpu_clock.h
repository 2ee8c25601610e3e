#ifndef CPU_CLOCK_H
#define CPU_CLOCK_H

/* The CPU time that this process has spent, in seconds: the clock that Python's `time.process_time` reads. */
double cpu_clock(void);

#endif
