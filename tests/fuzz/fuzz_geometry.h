/* fuzz_geometry.h: shapes, poses and boxes from any bytes. */
#ifndef FUZZ_GEOMETRY_H
#define FUZZ_GEOMETRY_H

#include <stddef.h>

/* Aborts when libgeom breaks a promise. */
void fuzz_geometry_one(const unsigned char *data, size_t size);

#endif
