/* The prefix of this unit's internal names (see prefix.h), and its FMI model identifier. */
#ifndef FEEDSIM_IDENTITY_H
#define FEEDSIM_IDENTITY_H

#define UNIT_NAME friction_gms

#endif
