/* Counts the ticks of its Clock by an increment; at each `every`-th count its output Clock `carry`
 * ticks, and `carried` is by one more.
 *
 * Three have a periodic Clock, of 1/10, 1/4 and 1/3 s; one is triggered, by another's `carry`. */
#include "frame/unit.h"

typedef struct {
    int32_t tick, carry, increment, count, before, every, carried, carried_before;
} Counter;

#define VARIABLES(...)                                                                                                 \
    {                                                                                                                  \
        {"tick", INPUT, CLOCK, offsetof(Counter, tick), ##__VA_ARGS__},                                                \
        {"carry", OUTPUT, CLOCK, offsetof(Counter, carry)},                                                            \
        {"increment", INPUT, INTEGER, offsetof(Counter, increment), .start = 1, .clock = "tick"},                      \
        {"count", OUTPUT, INTEGER, offsetof(Counter, count), .clock = "tick", .depends = "increment"},                 \
        {"every", PARAMETER, INTEGER, offsetof(Counter, every), .start = 2},                                           \
        {"carried", OUTPUT, INTEGER, offsetof(Counter, carried), .clock = "carry"},                                    \
    }
static const Variable of_tenths[] = VARIABLES(.counter = 1, .resolution = 10);
static const Variable of_quarters[] = VARIABLES(.counter = 1, .resolution = 4);
static const Variable of_thirds[] = VARIABLES(.counter = 1, .resolution = 3);
static const Variable triggered[] = VARIABLES();

static void outputs(Unit *unit) {
    SELF(Counter);
    if (!self->tick)
        return;
    self->count = self->before + self->increment;
    self->carry = self->every > 0 && self->count % self->every == 0;
    self->carried = self->carried_before + self->carry;
}

static void update(Unit *unit, Update *update) {
    SELF(Counter);
    self->before = self->count;
    self->carried_before = self->carried;
}

#define COUNTER(name, table)                                                                                           \
    static const Model name = {                                                                                        \
        #name, table, COUNT(table), 0.1, EVENTS, sizeof(Counter), .outputs = outputs, .update = update,                \
    };                                                                                                                 \
    UNIT(name)
COUNTER(counter_tenths, of_tenths)
COUNTER(counter_quarters, of_quarters)
COUNTER(counter_thirds, of_thirds)
COUNTER(counter_triggered, triggered)
