/* (offset + ticks * numerator) / denominator, rounded once: the same bits as Python's division of whole numbers. */
#include <math.h>

#include "plan.h"

typedef unsigned __int128 Wide;

static const uint64_t EXACT = (uint64_t)1 << 53; /* whole numbers up to here are doubles */

static double quotient_of(Wide product, uint64_t denominator) {
    if (product == 0)
        return 0;
    if (product <= EXACT && denominator <= EXACT)
        return (double)(uint64_t)product / (double)denominator; /* IEEE 754 rounds a quotient of two doubles once */

    Wide quotient = product / denominator;
    Wide rest = product % denominator;
    int shift = 0; /* the quotient is 2^shift times too large */
    while (quotient < EXACT << 2) {
        rest <<= 1;
        quotient = quotient << 1 | (rest >= denominator);
        if (rest >= denominator)
            rest -= denominator;
        shift++;
    }
    bool more = rest != 0;
    while (quotient >> 62) { /* two bits more than a double has are kept, and a sticky bit for all below them */
        more = more || (quotient & 1);
        quotient >>= 1;
        shift--;
    }
    return ldexp((double)((uint64_t)quotient | more), -shift);
}

double exact_time(int64_t offset, uint64_t ticks, uint64_t numerator, uint64_t denominator) {
    Wide passed = (Wide)ticks * numerator, before = offset < 0 ? -(Wide)offset : (Wide)offset;
    if (offset >= 0)
        return quotient_of(passed + before, denominator);
    return passed < before ? -quotient_of(before - passed, denominator) : quotient_of(passed - before, denominator);
}
