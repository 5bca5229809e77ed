/* The friction law, once more for the guides. */
#include "../friction_fmu/contact.c"
#include "../friction_fmu/lugre.c"
#include "../friction_fmu/tem.c"
