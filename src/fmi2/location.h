/* fmi2Instantiate's fmuResourceLocation -> a path. Importers differ: it comes as NULL, as file:/..., file:///...,
 * file://localhost/..., percent-encoded or not, or as a plain path. */
#ifndef FEEDSIM_LOCATION_H
#define FEEDSIM_LOCATION_H

#include <stdbool.h>

#include "prefix.h"

/* Write the UTF-8 path that `location` means to `path`, which has room for strlen(location) + 1 bytes; closing
 * separators are dropped. drive_letters: paths begin like C:/ (Windows). false where the location names no file (empty,
 * another scheme). */
bool location_path(const char *location, bool drive_letters, char *path);

#endif
