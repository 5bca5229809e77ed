#include "gms_parameters.h"

#include "../friction_fmu/take.h"

#define PLACE_spread ~, spread
#define PLACE_skew ~, skew
#define PLACE_C ~, C

#define VARIABLE(...) PUT(__VA_ARGS__)
Contact parameters_contact(const Scalars *v) {
    struct {
        Lugre lugre;
        double spread, skew, C;
    } contact = {.C = 0};
#include UNIT_TABLE
    return contact_make(&contact.lugre, contact.spread, contact.skew, contact.C);
}
#undef VARIABLE
