#ifndef FEEDSIM_IDENTITY_H
#define FEEDSIM_IDENTITY_H

#define UNIT_NAME toy

#endif
