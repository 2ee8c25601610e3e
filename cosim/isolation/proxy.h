/* The master's side: the functions of both standards, each of which lets the process of its unit make the call.
 *
 * An instance's pointer is its `Connection`. What a unit is set to between steps waits in the batch until the next
 * other call; after a step its process reads at once what the master asked for after the step before. */
#ifndef PROXY_H
#define PROXY_H

#include "calls.h"
#include "channel.h"

#define API __attribute__((visibility("default")))

typedef void (*Logger2)(void *, const char *, int, const char *, const char *, ...);
typedef void (*Logger3)(void *, int, const char *, const char *);

enum ending { RUNNING, BY_SIGNAL, BY_EXIT, BY_LIMIT, BY_MASTER, UNKNOWN };

/* What the master's side knows of a slot; its texts and binaries have `places`, as its values last held. */
typedef struct {
    int call;
    uint64_t at, values_at, n, n_values, bytes;
    uint32_t *references;
    uint64_t generation; /* of what was read last */
    bool asked;          /* since the last step */
} Known;

typedef struct Connection Connection;
struct Connection {
    Channel channel;
    char *base;
    size_t size;
    int file, number;
    long process;
    double limit; /* seconds that a call may take; 0: any */
    const volatile double *time; /* the simulated time of the call that the master makes, or NULL */
    Logger2 logger_2;
    Logger3 logger_3;
    void *environment;
    char *name;
    bool in_step_mode, uses_events, in_flight; /* in_flight: a step was begun and is not waited for */
    uint64_t step_at, flags_at[4]; /* the record of the step that is in flight, and what FMI 3 returns besides */
    uint64_t generation;  /* counts what may change variables */
    Known *known;
    size_t n_known;
    uint8_t mapped[MAX_MAPS]; /* by another instance's number: whether its memory is mapped: 1 yes, 2 it cannot be */
    int failed;           /* the call in which the last failure arose; -1: in the one that was asked for */
    enum ending ending;
    int ended_with;       /* the signal or the exit status */
    struct {
        uint64_t n;
        double first;     /* simulated time, s */
    } warned[N_CALLS];    /* the calls that answered Warning after they had returned OK */
    Connection *next;
};

/* A call under construction, and where its results go. */
typedef struct {
    uint64_t at, last; /* the record; where the last of its bytes were put */
    int n_arguments, n_results;
    struct {
        void *to;
        uint64_t from, size;
    } results[MAX_ARGUMENTS];
} Call;

void end_process(Connection *c, enum ending why);
/* Wait until the process has made the calls of the batch; return whether it has. */
bool await(Connection *c);
Connection *owner(const void *address);

Record *record(Connection *c, uint64_t at);
/* Return room at the end of the batch, 0 if there is none. */
uint64_t extend(Connection *c, Call *call, uint64_t size);
uint64_t copied(Connection *c, Call *call, const void *bytes, uint64_t size);
void add_argument(Connection *c, Call *call, uint64_t value, bool is_address);
bool open_call(Connection *c, Call *call, int id);
void give_number(Connection *c, Call *call, uint64_t number);
void give_real(Connection *c, Call *call, int i, double real);
void give_bytes(Connection *c, Call *call, const void *bytes, uint64_t size);
void give_text(Connection *c, Call *call, const char *text);
/* Texts, or where there are `sizes` binaries. */
void give_table(Connection *c, Call *call, const void *const *values, const size_t *sizes, uint64_t n);
void take_bytes(Connection *c, Call *call, void *bytes, uint64_t size);
/* The same memory is read and written by the unit. */
void give_and_take(Connection *c, Call *call, void *bytes, uint64_t size);
int close_call(Connection *c, Call *call);
int defer_call(Connection *c, Call *call);

int get_variables(Connection *c, int id, const uint32_t *references, size_t n, void *values, size_t n_values,
                  size_t bytes, size_t *sizes);
int set_variables(Connection *c, int id, const uint32_t *references, size_t n, const void *values,
                  size_t n_values, size_t bytes);
int set_table(Connection *c, int id, const uint32_t *references, size_t n, const void *const *values,
              const size_t *sizes, size_t n_values);

int set_debug_logging(Connection *c, int id, bool on, size_t n, const char *const names[]);
int set_up_experiment(Connection *c, int id, bool has_tolerance, double tolerance, double start, bool has_stop,
                      double stop);
int get_or_free_state(Connection *c, int id, void **state);
int set_state(Connection *c, int id, void *state);
int get_state_size(Connection *c, int id, void *state, size_t *size);
int serialize_state(Connection *c, int id, void *state, void *bytes, size_t size);
int deserialize_state(Connection *c, int id, const void *bytes, size_t size, void **state);

int call_plain(Connection *c, int id);
int read_known(Connection *c, Known *known);
void start_step(Connection *c, Call *call);
/* Wait for the step that is in flight; tell whether its results may be read. */
int end_step(Connection *c, bool *has_results);
Connection *take_next(void);
void change_mode(Connection *c, bool in_step_mode);

#define PLAIN(name)                                                                                                    \
    API int name(Connection *c) { return call_plain(c, CALL_##name); }

#endif
