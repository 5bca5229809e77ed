/* The native cycle loop: executes what the master has written a control cycle down as, on units that it has loaded.
 *
 * A cycle is a list of operations, worked through in order: calls of FMI functions on buffers that the master owns, and
 * small vector arithmetic in between. The loop knows neither units nor schemes nor recordings; which operations make a
 * cycle is the master's business (feedsim/simulation/cosim/schedule.py), and so is all memory. No globals, no
 * allocation, no printing: a call that fails ends the loop, and the unit has given its logger the reason.
 *
 * The master reads the layout below as text and leaves a library alone that has another one. */
#ifndef FEEDSIM_EXCHANGE_H
#define FEEDSIM_EXCHANGE_H

#include <stdint.h>

/* To be counted up when an operation comes to mean something else though the tables below stay. */
#define EXCHANGE_VERSION 5

/* The operations. FMI calls take values (slopes) from y or leave them there:
 *   set_real, set_slopes, get_real, get_slopes, get_boolean (int)   count variables by their references
 *   get_state, set_state                                            y holds one fmi2FMUstate; the first get fills it
 *   do_step                                                         from k T_c + s, over h
 *   finite                                                          entries of y that are not finite become 0; a counts
 *                                                                   how often there were any, in a row and in all, and
 *                                                                   more than s in a row are an error
 * Vectors have `count` entries, y may be one of the operands:
 *   copy     y = a
 *   line     y = a + s b
 *   rate     y = (a - b) / s
 *   bond     what the exchange between plant and friction does to the energies; a points to a Bond, s is the step
 * and `end` closes the list. These are done in every cycle; `due` is an operation of one of these kinds but bond,
 * `what`, that is done in some cycles only. */
#define EXCHANGE_KINDS(K)                                                                                              \
    K(set_real)                                                                                                        \
    K(set_slopes)                                                                                                      \
    K(do_step)                                                                                                         \
    K(get_real)                                                                                                        \
    K(get_slopes)                                                                                                      \
    K(get_boolean)                                                                                                     \
    K(get_state)                                                                                                       \
    K(set_state)                                                                                                       \
    K(finite)                                                                                                          \
    K(copy)                                                                                                            \
    K(line)                                                                                                            \
    K(rate)                                                                                                            \
    K(bond)                                                                                                            \
    K(due)                                                                                                             \
    K(end)

typedef void *address;
typedef void (*function)(void);

/* y is a buffer. Where an operation is `due` in cycle `next` and each `every` cycles from then on, it is a table of
 * `rows` rows that are `stride` bytes apart, used one after the other and over again. What most operations need comes
 * first. */
#define EXCHANGE_FIELDS(F)                                                                                             \
    F(int32_t, kind)                                                                                                   \
    F(int32_t, count)                                                                                                  \
    F(function, call)                                                                                                  \
    F(address, component)                                                                                              \
    F(address, references)                                                                                             \
    F(address, orders)                                                                                                 \
    F(address, y)                                                                                                      \
    F(double, s)                                                                                                       \
    F(double, h)                                                                                                       \
    F(address, a)                                                                                                      \
    F(address, b)                                                                                                      \
    F(int64_t, what)                                                                                                   \
    F(int64_t, every)                                                                                                  \
    F(int64_t, next)                                                                                                   \
    F(int64_t, stride)                                                                                                 \
    F(int64_t, rows)                                                                                                   \
    F(int64_t, row)

#define EXCHANGE_KIND(name) EXCHANGE_##name,
typedef enum ExchangeKind { EXCHANGE_KINDS(EXCHANGE_KIND) EXCHANGE_KIND_COUNT } ExchangeKind;

#define EXCHANGE_FIELD(type, name) type name;
typedef struct Operation {
    EXCHANGE_FIELDS(EXCHANGE_FIELD)
} Operation;

/* The bond between plant and friction at the end of an exchange step, every vector with an entry per axis. */
#define EXCHANGE_BOND(F)                                                                                               \
    F(address, M_fr)                                                                                                   \
    F(address, n)                                                                                                      \
    F(address, n_slope)                                                                                                \
    F(address, assumed_torque)                                                                                         \
    F(address, n_end)                                                                                                  \
    F(address, residual)                                                                                               \
    F(address, residual_peak)                                                                                          \
    F(address, dissipated)

typedef struct Bond {
    EXCHANGE_BOND(EXCHANGE_FIELD)
} Bond;

/* Where the loop ended early, or, of a mark, whose call it is.
 *
 * A loop with a mark looks after each call whether the processor computes as before (rounding, denormal numbers, traps)
 * and puts that back where it does not: changed_by is the first operation behind `looked_at` with such a call, else it
 * is left alone. */
typedef struct Fault {
    int64_t cycle;
    int64_t operation; /* index in the list */
    int64_t looked_at;
    int64_t changed_by;
} Fault;

#ifdef _WIN32
#define EXCHANGE_API __declspec(dllexport)
#elif defined(__GNUC__)
#define EXCHANGE_API __attribute__((visibility("default")))
#else
#define EXCHANGE_API
#endif

/* Version, kinds in their order, fields in theirs: "3: set_real set_slopes ..; int32_t kind, ..; address M_fr, ..". */
EXCHANGE_API const char *exchange_interface(void);

/* Work the cycles k with begin <= k < end, each T_c [s] long. The list is closed by an `end`. The operations keep count
 * of their rows: what follows continues at cycle `end`. Returns the fmi2Status (fmi2OK or fmi2Warning) 0, or that of
 * the call that failed, with *fault telling which; the operations ahead of it in that cycle are done. */
EXCHANGE_API int exchange_run(Operation operations[], double T_c, int64_t begin, int64_t end, Fault *fault);

/* The same; ahead of each call of a unit *fault says which it is, for who reads that memory when a call does not come
 * back. */
EXCHANGE_API int exchange_run_marked(Operation operations[], double T_c, int64_t begin, int64_t end, Fault *fault);

#endif
