#include "modal.h"

#include <math.h>
#include <string.h>

/* C99's restrict; compilers for C++ in the first place know it by another name. */
#ifdef _MSC_VER
#define UNALIASED __restrict
#else
#define UNALIASED restrict
#endif

#define COEFFICIENTS 8 /* of a mode's step */

/* Everything about a mode's step follows from its impulse response g (g(0) = 0, g'(0) = 1) and its integrals, here made
 * dimensionless with x = omega h:
 *   rate = g'(h),  once = g(h)/h,  twice = integral of g / h^2,  thrice = double integral of g / h^3
 * and hold, the response to a unit initial displacement. All tend to 1, 1, 1/2, 1/6 and 1 as x -> 0. */
typedef struct Response {
    double rate, once, twice, thrice, hold;
} Response;

/* Taylor series; p is the j-th derivative of g at 0 times h^(j-1). Used for x times the larger pole <= 2, where the
 * terms fall below the rounding error after 30 and cancel no more than a digit. Rigid modes are its first term. */
static Response response_series(double x, double zeta) {
    Response r = {0, 0, 0, 0, 0};
    double previous = 0, p = 1, factorial = 1;
    for (int j = 0; j < 30; j++) {
        r.rate += p / factorial;
        r.once += p / (factorial * (j + 1));
        r.twice += p / (factorial * (j + 1) * (j + 2));
        r.thrice += p / (factorial * (j + 1) * (j + 2) * (j + 3));
        factorial *= j + 1;
        const double next = -2 * zeta * x * p - x * x * previous;
        previous = p;
        p = next;
    }
    r.hold = 1 - x * x * r.twice;
    return r;
}

/* Integrals from the differential equation itself; loses accuracy for small x. */
static void response_integrals(Response *r, double x, double zeta) {
    r->twice = (1 - r->hold) / (x * x);
    r->thrice = (1 - r->once - 2 * zeta * x * r->twice) / (x * x);
}

static Response response_underdamped(double x, double zeta) {
    Response r;
    const double y = x * sqrt((1 - zeta) * (1 + zeta)), decay = exp(-zeta * x);
    r.once = decay * sin(y) / y;
    r.rate = decay * cos(y) - zeta * x * r.once;
    r.hold = decay * cos(y) + zeta * x * r.once;
    response_integrals(&r, x, zeta);
    return r;
}

/* (1 - exp(-a))/a and (exp(-a) - 1 + a)/a^2 for a >= 0 */
static double decay_mean(double a) {
    return a > 0 ? -expm1(-a) / a : 1;
}

static double decay_mean_2(double a) {
    if (a > 1) {
        return (1 - decay_mean(a)) / a;
    }
    double sum = 0, term = 0.5;
    for (int j = 3; j < 22; j++) {
        sum += term;
        term *= -a / j;
    }
    return sum;
}

/* zeta >= 1: poles -omega slow, -omega fast with slow fast = 1; equal poles included. */
static Response response_overdamped(double x, double fast_rate) {
    Response r;
    const double fast = fast_rate * x, slow = x / fast_rate, gap = fast - slow;
    r.once = exp(-slow) * decay_mean(gap);
    r.rate = exp(-fast) - slow * r.once;
    r.hold = exp(-fast) + fast * r.once;
    if (slow >= 1) {
        response_integrals(&r, x, (fast + slow) / (2 * x));
    } else { /* here fast > 2, so that the gap is wide and the differences do not cancel */
        r.twice = (decay_mean(slow) - decay_mean(fast)) / gap;
        r.thrice = (decay_mean_2(slow) - decay_mean_2(fast)) / gap;
    }
    return r;
}

ModeUpdate mode_update(double omega, double zeta, double h) {
    const double x = omega * h;
    const double fast_rate = zeta < 1 ? 1 : zeta + sqrt(zeta - 1) * sqrt(zeta + 1);
    Response r;
    if (fast_rate * x <= 2) {
        r = response_series(x, zeta);
    } else if (zeta < 1) {
        r = response_underdamped(x, zeta);
    } else {
        r = response_overdamped(x, fast_rate);
    }
    return (ModeUpdate){.q_q = r.hold,
                        .q_v = h * r.once,
                        .q_f = h * h * r.twice,
                        .q_df = h * h * r.thrice,
                        .v_q = -omega * x * r.once,
                        .v_v = r.rate,
                        .v_f = h * r.once,
                        .v_df = h * r.twice};
}

size_t modal_padded(size_t modes) {
    return (modes + MODAL_LANES - 1) / MODAL_LANES * MODAL_LANES;
}

size_t modal_memory(size_t modes, size_t ports) {
    return (2 + COEFFICIENTS + ports) * modal_padded(modes);
}

void modal_place(Modal *modal, double *memory, size_t modes, size_t ports) {
    const size_t size = modal_padded(modes);
    modal->size = size;
    modal->ports = ports;
    modal->h = 0;
    modal->omega = memory;
    modal->zeta = modal->omega + size;
    modal->update = modal->zeta + size;
    modal->shape = modal->update + COEFFICIENTS * size;
}

void modal_set_mode(Modal *modal, size_t mode, double omega, double zeta, const double *shape) {
    modal->omega[mode] = omega;
    modal->zeta[mode] = zeta;
    for (size_t i = 0; i < modal->ports; i++) {
        modal->shape[i * modal->size + mode] = shape[i];
    }
}

void modal_prepare(Modal *modal, double h) {
    if (h == modal->h) {
        return;
    }
    for (size_t k = 0; k < modal->size; k++) {
        const ModeUpdate update = mode_update(modal->omega[k], modal->zeta[k], h);
        const double c[COEFFICIENTS] = {update.q_q, update.q_v, update.q_f, update.q_df,
                                        update.v_q, update.v_v, update.v_f, update.v_df};
        const size_t lane = k % MODAL_LANES;
        for (size_t i = 0; i < COEFFICIENTS; i++) {
            modal->update[(k - lane) * COEFFICIENTS + i * MODAL_LANES + lane] = c[i];
        }
    }
    modal->h = h;
}

/* MODAL_LANES numbers side by side, each computed like the others. The type names them a vector where the compiler has
 * vectors: without it, one compiler pairs lanes that lie apart. Written out, since loops stay in memory. */
#ifdef __GNUC__
typedef double LanePart __attribute__((vector_size(2 * sizeof(double))));
#define EACH_PART(work) work(0) work(1)
#else
typedef double LanePart;
#define EACH_PART(work) work(0) work(1) work(2) work(3)
#endif

#define LANES_OF_PART (sizeof(LanePart) / sizeof(double))

typedef struct Lanes {
    LanePart at[MODAL_LANES / LANES_OF_PART];
} Lanes;

static inline void lanes_read(Lanes *x, const double *from) {
#define WORK(i) memcpy(&x->at[i], from + (i) * LANES_OF_PART, sizeof x->at[i]);
    EACH_PART(WORK)
#undef WORK
}

static inline void lanes_write(double *to, const Lanes *x) {
#define WORK(i) memcpy(to + (i) * LANES_OF_PART, &x->at[i], sizeof x->at[i]);
    EACH_PART(WORK)
#undef WORK
}

static inline void lanes_add_scaled(Lanes *sum, const Lanes *a, double factor) {
#define WORK(i) sum->at[i] += a->at[i] * factor;
    EACH_PART(WORK)
#undef WORK
}

static inline void lanes_add_product(Lanes *sum, const Lanes *a, const Lanes *b) {
#define WORK(i) sum->at[i] += a->at[i] * b->at[i];
    EACH_PART(WORK)
#undef WORK
}

/* A mode's q or v at the end of a step, with its four coefficients at c. */
static inline void lanes_end(double *end, const double *c, const Lanes *q, const Lanes *v, const Lanes *f,
                             const Lanes *df) {
    Lanes c_q, c_v, c_f, c_df, sum;
    lanes_read(&c_q, c);
    lanes_read(&c_v, c + MODAL_LANES);
    lanes_read(&c_f, c + 2 * MODAL_LANES);
    lanes_read(&c_df, c + 3 * MODAL_LANES);
#define WORK(i)                                                                                                        \
    sum.at[i] = (c_q.at[i] * q->at[i] + c_v.at[i] * v->at[i]) + (c_f.at[i] * f->at[i] + c_df.at[i] * df->at[i]);
    EACH_PART(WORK)
#undef WORK
    lanes_write(end, &sum);
}

/* Compiled by itself for every call with its number of inputs: in a step, nothing takes longer. */
#ifdef __GNUC__
#define INLINED static inline __attribute__((always_inline))
#else
#define INLINED static inline
#endif
#if defined(__GNUC__) && !defined(__clang__) /* which does so by itself */
#define UNROLLED _Pragma("GCC unroll 4")
#else
#define UNROLLED
#endif

/* Inputs at the ports of those shapes, NULL: at the first of all ports; held: modal forces besides, NULL: none. */
INLINED void modal_advance_from(const Modal *modal, size_t inputs, const double *const *UNALIASED shapes,
                                const double *UNALIASED u, const double *UNALIASED du, const double *UNALIASED held,
                                const double *UNALIASED q, const double *UNALIASED v, double *UNALIASED q_end,
                                double *UNALIASED v_end) {
    const size_t size = modal->size;
    const double *UNALIASED c = modal->update;
    for (size_t k = 0; k < size; k += MODAL_LANES, c += COEFFICIENTS * MODAL_LANES) {
        Lanes f = {{{0}}}, df = {{{0}}}, q_k, v_k;
        const double *UNALIASED b = modal->shape + k;
        if (held != NULL) {
            lanes_read(&f, held + k);
        }
        UNROLLED
        for (size_t i = 0; i < inputs; i++, b += size) {
            Lanes b_k;
            lanes_read(&b_k, shapes == NULL ? b : shapes[i] + k);
            lanes_add_scaled(&f, &b_k, u[i]);
            lanes_add_scaled(&df, &b_k, du[i]);
        }
        lanes_read(&q_k, q + k);
        lanes_read(&v_k, v + k);
        lanes_end(q_end + k, c, &q_k, &v_k, &f, &df);
        lanes_end(v_end + k, c + 4 * MODAL_LANES, &q_k, &v_k, &f, &df);
    }
}

void modal_advance(const Modal *modal, size_t inputs, const double *u, const double *du, const double *q,
                   const double *v, double *q_end, double *v_end) {
    if (inputs == 3) { /* machines of three axes without forces on tool and slides */
        modal_advance_from(modal, 3, NULL, u, du, NULL, q, v, q_end, v_end);
    } else {
        modal_advance_from(modal, inputs, NULL, u, du, NULL, q, v, q_end, v_end);
    }
}

void modal_advance_held(const Modal *modal, size_t inputs, const double *u, const double *du, const double *held,
                        const double *q, const double *v, double *q_end, double *v_end) {
    if (inputs == 3) {
        modal_advance_from(modal, 3, NULL, u, du, held, q, v, q_end, v_end);
    } else {
        modal_advance_from(modal, inputs, NULL, u, du, held, q, v, q_end, v_end);
    }
}

void modal_advance_at(const Modal *modal, size_t inputs, const double *const *shapes, const double *u, const double *du,
                      const double *held, const double *q, const double *v, double *q_end, double *v_end) {
    if (held != NULL) {
        modal_advance_from(modal, inputs, shapes, u, du, held, q, v, q_end, v_end);
    } else if (inputs == 3) {
        modal_advance_from(modal, 3, shapes, u, du, NULL, q, v, q_end, v_end);
    } else if (inputs == 4) {
        modal_advance_from(modal, 4, shapes, u, du, NULL, q, v, q_end, v_end);
    } else {
        modal_advance_from(modal, inputs, shapes, u, du, NULL, q, v, q_end, v_end);
    }
}

void modal_forecast(const Modal *modal, size_t port, bool speed, Forecast *forecast) {
    const size_t size = modal->size, part = speed ? 4 * MODAL_LANES : 0;
    for (size_t from = 0; from < modal->ports; from++) {
        forecast->held[from] = forecast->ramp[from] = 0;
    }
    for (size_t k = 0; k < size; k++) {
        const size_t lane = k % MODAL_LANES;
        const double *c = modal->update + (k - lane) * COEFFICIENTS + part + lane;
        const double b = modal->shape[port * size + k];
        forecast->q[k] = b * c[0];
        forecast->v[k] = b * c[MODAL_LANES];
        forecast->f[k] = b * c[2 * MODAL_LANES];
        for (size_t from = 0; from < modal->ports; from++) {
            const double shapes = b * modal->shape[from * size + k];
            forecast->held[from] += shapes * c[2 * MODAL_LANES];
            forecast->ramp[from] += shapes * c[3 * MODAL_LANES];
        }
    }
}

/* Partial sums, in the order that every platform adds in. */
static inline double lanes_total(const Lanes *x) {
    double s[MODAL_LANES];
    lanes_write(s, x);
    return (s[0] + s[1]) + (s[2] + s[3]);
}

double modal_foretold(const Forecast *forecast, size_t size, const double *UNALIASED q, const double *UNALIASED v) {
    Lanes sum = {{{0}}};
    for (size_t k = 0; k < size; k += MODAL_LANES) {
        Lanes by_q, by_v, q_k, v_k;
        lanes_read(&by_q, forecast->q + k);
        lanes_read(&by_v, forecast->v + k);
        lanes_read(&q_k, q + k);
        lanes_read(&v_k, v + k);
        lanes_add_product(&sum, &by_q, &q_k);
        lanes_add_product(&sum, &by_v, &v_k);
    }
    return lanes_total(&sum);
}

void modal_force(const Modal *modal, const double *UNALIASED u, double *UNALIASED f) {
    const size_t size = modal->size, ports = modal->ports;
    size_t k = 0;
    for (; k + 2 * MODAL_LANES <= size; k += 2 * MODAL_LANES) { /* two at a time: u is read once for them */
        Lanes sum_0 = {{{0}}}, sum_1 = {{{0}}}, b_k;
        const double *UNALIASED b = modal->shape + k;
        for (size_t i = 0; i < ports; i++, b += size) {
            lanes_read(&b_k, b);
            lanes_add_scaled(&sum_0, &b_k, u[i]);
            lanes_read(&b_k, b + MODAL_LANES);
            lanes_add_scaled(&sum_1, &b_k, u[i]);
        }
        lanes_write(f + k, &sum_0);
        lanes_write(f + k + MODAL_LANES, &sum_1);
    }
    if (k < size) {
        Lanes sum = {{{0}}}, b_k;
        for (size_t i = 0; i < ports; i++) {
            lanes_read(&b_k, modal->shape + i * size + k);
            lanes_add_scaled(&sum, &b_k, u[i]);
        }
        lanes_write(f + k, &sum);
    }
}

double modal_sum(const Modal *modal, size_t port, const double *UNALIASED q) {
    const size_t size = modal->size;
    const double *UNALIASED b = modal->shape + port * size;
    Lanes sum = {{{0}}};
    for (size_t k = 0; k < size; k += MODAL_LANES) {
        Lanes b_k, q_k;
        lanes_read(&b_k, b + k);
        lanes_read(&q_k, q + k);
        lanes_add_product(&sum, &b_k, &q_k);
    }
    return lanes_total(&sum);
}

void modal_sums(const Modal *modal, size_t port, size_t count, const double *UNALIASED q, double *y) {
    const size_t size = modal->size;
    size_t i = 0;
    for (; i + 3 <= count; i += 3) { /* as many sums as registers hold: q is read once for them */
        const double *UNALIASED b = modal->shape + (port + i) * size;
        Lanes sum_0 = {{{0}}}, sum_1 = {{{0}}}, sum_2 = {{{0}}};
        for (size_t k = 0; k < size; k += MODAL_LANES) {
            Lanes b_k, q_k;
            lanes_read(&q_k, q + k);
            lanes_read(&b_k, b + k);
            lanes_add_product(&sum_0, &b_k, &q_k);
            lanes_read(&b_k, b + size + k);
            lanes_add_product(&sum_1, &b_k, &q_k);
            lanes_read(&b_k, b + 2 * size + k);
            lanes_add_product(&sum_2, &b_k, &q_k);
        }
        y[i] = lanes_total(&sum_0);
        y[i + 1] = lanes_total(&sum_1);
        y[i + 2] = lanes_total(&sum_2);
    }
    for (; i < count; i++) {
        y[i] = modal_sum(modal, port + i, q);
    }
}

double modal_acceleration(const Modal *modal, size_t port, size_t inputs, const double *u, const double *q,
                          const double *v) {
    double sum = 0;
    for (size_t k = 0; k < modal->size; k++) {
        const double omega = modal->omega[k];
        double f = -omega * (omega * q[k] + 2 * modal->zeta[k] * v[k]);
        for (size_t i = 0; i < inputs; i++) {
            f += modal->shape[i * modal->size + k] * u[i];
        }
        sum += modal->shape[port * modal->size + k] * f;
    }
    return sum;
}

double modal_kinetic_energy(const Modal *modal, const double *v) {
    double sum = 0;
    for (size_t k = 0; k < modal->size; k++) {
        sum += v[k] * v[k];
    }
    return sum / 2;
}

double modal_elastic_energy(const Modal *modal, const double *q) {
    double sum = 0;
    for (size_t k = 0; k < modal->size; k++) {
        const double root = modal->omega[k] * q[k];
        sum += root * root;
    }
    return sum / 2;
}
