/* The prefix of this unit's internal names (see prefix.h), its FMI model identifier, and the kind of its resources. */
#ifndef FEEDSIM_IDENTITY_H
#define FEEDSIM_IDENTITY_H

#define UNIT_NAME machine
#define UNIT_RESOURCES whole_machine

#endif
