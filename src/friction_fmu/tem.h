/* Transmission engaging model: after a reversal the drive train's parts come into engagement one after the other, so
 * that at first only a share of the bristle stiffness acts.
 *
 *   k      = gamma + lambda (1 - gamma)                                                              (2)
 *   lambda = (W/2 + c)/W for z >= 0,  (W/2 - c)/W for z < 0                                          (3)
 *   c      = clip(c + travelled angle, -W/2, +W/2)                                                   (4)
 *
 * Source: Wiesauer, Bleicher, 18th CIRP CMMO (2021). The print of (4) has the wrong sign in its second case: it must
 * read <= -W/2. W = 0 switches the model off: lambda = k = 1. Pure functions. */
#ifndef FEEDSIM_TEM_H
#define FEEDSIM_TEM_H

#include "prefix.h"

#define tem_advance PREFIXED(tem_advance)
#define tem_engagement PREFIXED(tem_engagement)
#define tem_share PREFIXED(tem_share)

/* c [rad] after travelling `angle` [rad] in one direction; width W [rad] >= 0. */
double tem_advance(double c, double angle, double W);

/* lambda [1], 0 to 1, at bristle deflection z [rad] and position c [rad] in the engaging zone. */
double tem_engagement(double z, double c, double W);

/* k [1], gamma to 1: the engaged share of the bristle stiffness. */
double tem_share(double lambda, double gamma);

#endif
