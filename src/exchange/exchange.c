#include "exchange.h"

#include <fenv.h>

#include "fmi2FunctionTypes.h"
#include "vectors.h"

#ifdef __GNUC__
#define ALWAYS_INLINE inline __attribute__((always_inline))
#else
#define ALWAYS_INLINE inline
#endif

#define TEXT(number) TEXT_OF(number)
#define TEXT_OF(number) #number
#define KIND_TEXT(name) " " #name
#define FIELD_TEXT(type, name) " " #type " " #name ","

const char *exchange_interface(void) {
    return TEXT(EXCHANGE_VERSION) ":" EXCHANGE_KINDS(KIND_TEXT) ";" EXCHANGE_FIELDS(FIELD_TEXT) ";" EXCHANGE_BOND(
        FIELD_TEXT);
}

/* Where an operation's values are in this cycle; the row of a table is used up by it. */
static address take_row(Operation *o) {
    const address row = (char *)o->y + o->row * o->stride;
    o->row = o->row + 1 == o->rows ? 0 : o->row + 1;
    o->next += o->every;
    return row;
}

/* --- calls of every cycle */

static inline fmi2Status set_real(const Operation *o, address y) {
    return ((fmi2SetRealTYPE *)o->call)(o->component, o->references, (size_t)o->count, y);
}

static inline fmi2Status set_slopes(const Operation *o, address y) {
    return ((fmi2SetRealInputDerivativesTYPE *)o->call)(o->component, o->references, (size_t)o->count, o->orders, y);
}

static inline fmi2Status do_step(const Operation *o, double t) {
    return ((fmi2DoStepTYPE *)o->call)(o->component, t + o->s, o->h, fmi2True);
}

static inline fmi2Status get_real(const Operation *o, address y) {
    return ((fmi2GetRealTYPE *)o->call)(o->component, o->references, (size_t)o->count, y);
}

static inline fmi2Status get_slopes(const Operation *o, address y) {
    return ((fmi2GetRealOutputDerivativesTYPE *)o->call)(o->component, o->references, (size_t)o->count, o->orders, y);
}

/* --- arithmetic */

static inline void work_out(const Operation *o) {
    const size_t n = (size_t)o->count;
    if (o->kind == EXCHANGE_line) {
        vector_line(n, o->y, o->a, o->s, o->b);
    } else if (o->kind == EXCHANGE_copy) {
        vector_copy(n, o->y, o->a);
    } else if (o->kind == EXCHANGE_rate) {
        vector_rate(n, o->y, o->a, o->b, o->s);
    } else {
        const Bond *b = o->a;
        bond_exchange(n, o->s, b->M_fr, b->n, b->n_slope, b->assumed_torque, b->n_end, b->residual, b->residual_peak,
                      b->dissipated);
    }
}

/* --- how the processor computes: rounding, denormal numbers, traps; not the flags of past operations */

#if defined(__GNUC__) && defined(__x86_64__)
static ALWAYS_INLINE uint64_t settings(void) {
    uint32_t sse;
    uint16_t x87;
    __asm__ volatile("stmxcsr %0\n\tfnstcw %1" : "=m"(sse), "=m"(x87));
    return (uint64_t)x87 << 32 | (sse & 0xffc0u);
}

static void put_back(uint64_t kept) {
    const uint32_t sse = (uint32_t)kept;
    const uint16_t x87 = (uint16_t)(kept >> 32);
    __asm__ volatile("fnclex\n\tldmxcsr %0\n\tfldcw %1"
                     :
                     : "m"(sse), "m"(x87)
                     : "memory"); /* what is pending would trap */
}
#elif defined(__GNUC__) && defined(__aarch64__)
static ALWAYS_INLINE uint64_t settings(void) {
    uint64_t control;
    __asm__ volatile("mrs %0, fpcr" : "=r"(control));
    return control;
}

static void put_back(uint64_t kept) {
    __asm__ volatile("msr fpcr, %0" : : "r"(kept) : "memory");
}
#else
static ALWAYS_INLINE uint64_t settings(void) {
    return (uint64_t)fegetround();
}

static void put_back(uint64_t kept) {
    fesetround((int)kept);
}
#endif

/* --- any operation */

static fmi2Status make_finite(const Operation *o) {
    double *y = o->y, *count = o->a;
    int missing = 0;
    for (int32_t i = 0; i < o->count; i++) {
        if (!isfinite(y[i])) {
            y[i] = 0;
            missing = 1;
        }
    }
    count[0] = missing ? count[0] + 1 : 0;
    count[1] += missing;
    return count[0] > o->s ? fmi2Error : fmi2OK;
}

static fmi2Status execute(const Operation *o, int64_t kind, address y, double t) {
    const size_t n = (size_t)o->count;
    switch ((ExchangeKind)kind) {
    case EXCHANGE_set_real:
        return set_real(o, y);
    case EXCHANGE_set_slopes:
        return set_slopes(o, y);
    case EXCHANGE_do_step:
        return do_step(o, t);
    case EXCHANGE_get_real:
        return get_real(o, y);
    case EXCHANGE_get_slopes:
        return get_slopes(o, y);
    case EXCHANGE_get_boolean:
        return ((fmi2GetBooleanTYPE *)o->call)(o->component, o->references, n, y);
    case EXCHANGE_get_state:
        return ((fmi2GetFMUstateTYPE *)o->call)(o->component, y);
    case EXCHANGE_set_state:
        return ((fmi2SetFMUstateTYPE *)o->call)(o->component, *(fmi2FMUstate *)y);
    case EXCHANGE_finite:
        return make_finite(o);
    case EXCHANGE_copy:
        vector_copy(n, y, o->a);
        break;
    case EXCHANGE_line:
        vector_line(n, y, o->a, o->s, o->b);
        break;
    case EXCHANGE_rate:
        vector_rate(n, y, o->a, o->b, o->s);
        break;
    case EXCHANGE_bond:
    case EXCHANGE_due:
    case EXCHANGE_end:
    case EXCHANGE_KIND_COUNT:
    default:
        return fmi2Fatal; /* the master compiles no such operation */
    }
    return fmi2OK;
}

static fmi2Status work_rest(Operation *o, int64_t k, double t) {
    if (o->kind != EXCHANGE_due) {
        return execute(o, o->kind, o->y, t);
    }
    return o->next == k ? execute(o, o->what, take_row(o), t) : fmi2OK;
}

/* Whose call comes next, in memory that another process reads; without a mark, as a constant, nothing is left of it. */
static ALWAYS_INLINE void note(Fault *mark, int64_t cycle, int64_t operation) {
    if (mark) {
        *(volatile int64_t *)&mark->cycle = cycle;
        *(volatile int64_t *)&mark->operation = operation;
    }
}

/* Behind a call; without a mark nothing is left of it either. */
static ALWAYS_INLINE void look_after(Fault *mark, uint64_t kept, int64_t operation) {
    if (mark && settings() != kept) {
        put_back(kept);
        if (mark->changed_by < 0 && operation > mark->looked_at) {
            mark->changed_by = operation;
        }
    }
}

/* FMI has no other status that goes on. */
static ALWAYS_INLINE int failed(fmi2Status status) {
    return (unsigned)status > fmi2Warning;
}

/* One cycle, from operation *at on; where it ends, the closing one or the one that failed.
 *
 * Operations mostly come as turns of a unit: values and slopes set, a step, values and slopes got. Comparisons with
 * what a turn has next mostly come out the same, which a processor foresees better than where a switch leads. */
static ALWAYS_INLINE fmi2Status work(Operation **at, int64_t k, double t, const Operation operations[], Fault *mark,
                                     uint64_t kept) {
    Operation *o = *at;
    fmi2Status status = fmi2OK;
#define PART(part, argument)                                                                                           \
    if (o->kind == EXCHANGE_##part) {                                                                                  \
        note(mark, k, o - operations);                                                                                 \
        status = part(o, argument);                                                                                    \
        look_after(mark, kept, o - operations);                                                                        \
        if (failed(status))                                                                                            \
            break;                                                                                                     \
        o++;                                                                                                           \
    }
    for (;;) {
        PART(set_real, o->y)
        PART(set_slopes, o->y)
        PART(do_step, t)
        PART(get_real, o->y)
        PART(get_slopes, o->y)
        while (o->kind >= EXCHANGE_copy && o->kind <= EXCHANGE_bond) {
            work_out(o++);
        }
        if (o->kind < EXCHANGE_get_boolean) {
            continue;
        }
        if (o->kind == EXCHANGE_end) {
            break;
        }
        note(mark, k, o - operations);
        status = work_rest(o, k, t);
        look_after(mark, kept, o - operations);
        if (failed(status)) {
            break;
        }
        o++;
    }
#undef PART
    *at = o;
    return status;
}

/* The operations that are due in some cycles only and stand at the head of the list: how many there are, and the first
 * cycle in which one of them is due. */
static int64_t count_head(const Operation operations[]) {
    int64_t count = 0;
    while (operations[count].kind == EXCHANGE_due) {
        count++;
    }
    return count;
}

static int64_t first_due(const Operation operations[], int64_t count) {
    int64_t first = INT64_MAX;
    for (int64_t i = 0; i < count; i++) {
        first = operations[i].next < first ? operations[i].next : first;
    }
    return first;
}

static ALWAYS_INLINE int run(Operation operations[], double T_c, int64_t begin, int64_t end, Fault *fault,
                             Fault *mark) {
    const int64_t head = count_head(operations);
    const uint64_t kept = mark ? settings() : 0;
    int64_t due = begin;
    for (int64_t k = begin; k < end; k++) {
        Operation *at = k < due ? operations + head : operations;
        const fmi2Status status = work(&at, k, (double)k * T_c, operations, mark, kept);
        if (failed(status)) {
            fault->cycle = k;
            fault->operation = at - operations;
            return (int)status;
        }
        if (k >= due) {
            due = first_due(operations, head);
        }
    }
    return fmi2OK;
}

int exchange_run(Operation operations[], double T_c, int64_t begin, int64_t end, Fault *fault) {
    return run(operations, T_c, begin, end, fault, NULL);
}

int exchange_run_marked(Operation operations[], double T_c, int64_t begin, int64_t end, Fault *fault) {
    return run(operations, T_c, begin, end, fault, fault);
}
