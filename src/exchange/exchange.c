#include "exchange.h"

#include "fmi2FunctionTypes.h"
#include "vectors.h"

#define TEXT(number) TEXT_OF(number)
#define TEXT_OF(number) #number
#define KIND_TEXT(name) " " #name
#define FIELD_TEXT(type, name) " " #type " " #name ","

const char *exchange_interface(void) {
    return TEXT(EXCHANGE_VERSION) ":" EXCHANGE_KINDS(KIND_TEXT) ";" EXCHANGE_FIELDS(FIELD_TEXT);
}

/* Where an operation's values are in this cycle; the row of a table is used up by it. */
static address take_row(Operation *o) {
    const address row = (char *)o->y + o->row * o->stride;
    o->row = o->row + 1 == o->rows ? 0 : o->row + 1;
    o->next += o->every;
    return row;
}

static fmi2Status execute(const Operation *o, address y, double t) {
    const size_t n = (size_t)o->count;
    switch ((ExchangeKind)o->kind) {
    case EXCHANGE_set_real:
        return ((fmi2SetRealTYPE *)o->call)(o->component, o->references, n, y);
    case EXCHANGE_set_slopes:
        return ((fmi2SetRealInputDerivativesTYPE *)o->call)(o->component, o->references, n, o->orders, y);
    case EXCHANGE_do_step:
        return ((fmi2DoStepTYPE *)o->call)(o->component, t + o->s, o->h, fmi2True);
    case EXCHANGE_get_real:
        return ((fmi2GetRealTYPE *)o->call)(o->component, o->references, n, y);
    case EXCHANGE_get_slopes:
        return ((fmi2GetRealOutputDerivativesTYPE *)o->call)(o->component, o->references, n, o->orders, y);
    case EXCHANGE_get_boolean:
        return ((fmi2GetBooleanTYPE *)o->call)(o->component, o->references, n, y);
    case EXCHANGE_get_state:
        return ((fmi2GetFMUstateTYPE *)o->call)(o->component, y);
    case EXCHANGE_set_state:
        return ((fmi2SetFMUstateTYPE *)o->call)(o->component, *(fmi2FMUstate *)y);
    case EXCHANGE_copy:
        vector_copy(n, y, o->a);
        break;
    case EXCHANGE_line:
        vector_line(n, y, o->a, o->s, o->b);
        break;
    case EXCHANGE_rate:
        vector_rate(n, y, o->a, o->b, o->s);
        break;
    case EXCHANGE_product:
        vector_product(n, y, o->a, o->b);
        break;
    case EXCHANGE_peak:
        vector_peak(n, y, o->a);
        break;
    case EXCHANGE_KIND_COUNT:
    default:
        return fmi2Fatal; /* the master compiles no such operation */
    }
    return fmi2OK;
}

int exchange_run(Operation operations[], int64_t count, double T_c, int64_t begin, int64_t end, Fault *fault) {
    for (int64_t k = begin; k < end; k++) {
        const double t = (double)k * T_c;
        for (int64_t i = 0; i < count; i++) {
            Operation *o = &operations[i];
            if (o->every != 0 && o->next != k)
                continue;
            const fmi2Status status = execute(o, o->every != 0 ? take_row(o) : o->y, t);
            if (status > fmi2Warning) {
                *fault = (Fault){k, i};
                return (int)status;
            }
        }
    }
    return fmi2OK;
}
