/* y = u, but a step ends only when the partner's step of the same number has begun: both must go on at the same time.
 *
 * They meet by files in the folder MEETING_FOLDER; without it, none waits. One that waits for 20 s answers Error. */
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "frame/unit.h"

typedef struct {
    double u, y;
    int32_t who, n;
} Meeting;

static const Variable variables[] = {
    {"u", INPUT, REAL, offsetof(Meeting, u), .start = 1},
    {"y", OUTPUT, REAL, offsetof(Meeting, y)},
    {"who", PARAMETER, INTEGER, offsetof(Meeting, who)},
    {"n", OUTPUT, INTEGER, offsetof(Meeting, n)},
};

static FILE *token(const char *folder, int who, int n, const char *mode) {
    char path[1024];
    snprintf(path, sizeof path, "%s/%d-%d", folder, who, n);
    return fopen(path, mode);
}

static enum status step(Unit *unit, double t, double h, StepEnd *end) {
    SELF(Meeting);
    const char *folder = getenv("MEETING_FOLDER");
    self->y = self->u;
    self->n++;
    FILE *mine = folder ? token(folder, self->who, self->n, "w") : NULL, *partners = NULL;
    if (mine)
        fclose(mine);
    for (int i = 0; mine && !partners && i < 20000; i++) {
        partners = token(folder, 1 - self->who, self->n, "r");
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
    if (mine && !partners) {
        say(unit, ERROR, "nobody came in step %d", self->n);
        return ERROR;
    }
    if (partners)
        fclose(partners);
    return OK;
}

static const Model meets = {"meets", variables, COUNT(variables), 0.1, 0, sizeof(Meeting), NULL, NULL, NULL, step};
UNIT(meets)
