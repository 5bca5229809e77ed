#include "parameters.h"

#include "take.h"

#define PLACE_W ~, W
#define PLACE_gamma ~, gamma

#define VARIABLE(...) TAKE(__VA_ARGS__)
bool parameters_take(const double values[], Scalars *v) {
    bool good = true;
#include "variables.def"
    return good;
}
#undef VARIABLE

bool parameters_agree(const Scalars *v) {
    return v->F_S >= v->F_C;
}

#define VARIABLE(...) PUT(__VA_ARGS__)
Contact parameters_contact(const Scalars *v) {
    Contact contact = {0};
#include UNIT_TABLE
    return contact;
}
#undef VARIABLE
