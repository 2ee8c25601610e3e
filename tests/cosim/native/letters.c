/* A sender sends the same letter at each tick of its Clock of 1/10 s, at which its output Clock `sent` ticks, too. A letter
 * box takes each letter out once its Clock has ticked, and counts those that were in it; its Clock is triggered, or has
 * the interval of the sender's. */
#include <string.h>

#include "frame/unit.h"

typedef struct {
    Bytes letter;
    int32_t tick, sent, received;
} Post;

static const Variable of_sender[] = {
    {"tick", INPUT, CLOCK, offsetof(Post, tick), .counter = 1, .resolution = 10},
    {"sent", OUTPUT, CLOCK, offsetof(Post, sent)},
    {"letter", OUTPUT, BINARY, offsetof(Post, letter), .clock = "sent"},
};

#define LETTER_BOX(...)                                                                                                \
    {                                                                                                                  \
        {"tick", INPUT, CLOCK, offsetof(Post, tick), ##__VA_ARGS__},                                                   \
        {"letter", INPUT, BINARY, offsetof(Post, letter), .clock = "tick"},                                            \
        {"received", OUTPUT, INTEGER, offsetof(Post, received)},                                                       \
    }
static const Variable triggered[] = LETTER_BOX();
static const Variable of_tenths[] = LETTER_BOX(.counter = 1, .resolution = 10);

static void send(Unit *unit) {
    SELF(Post);
    self->sent = self->tick;
    self->letter.size = 2;
    memcpy(self->letter.bytes, "hi", 2);
}

static void take_out(Unit *unit, Update *update) {
    SELF(Post);
    if (self->tick && self->letter.size)
        self->received++;
    self->letter.size = 0;
}

static const Model sender = {
    "sender", of_sender, COUNT(of_sender), 0.1, EVENTS, sizeof(Post), .outputs = send,
};
UNIT(sender)

#define BOX(name, table)                                                                                               \
    static const Model name = {                                                                                        \
        #name, table, COUNT(table), 0.1, EVENTS, sizeof(Post), .update = take_out,                                     \
    };                                                                                                                 \
    UNIT(name)
BOX(letter_box, triggered)
BOX(letter_box_tenths, of_tenths)
