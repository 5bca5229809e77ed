#include "parameters.h"

#include "take.h"

#define PLACE_W ~, W
#define PLACE_gamma ~, gamma

#define VARIABLE(...) PUT(__VA_ARGS__)
Contact parameters_contact(const Scalars *v) {
    Contact contact = {0};
#include UNIT_TABLE
    return contact;
}
#undef VARIABLE
