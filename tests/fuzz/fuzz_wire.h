/* fuzz_wire.h: see fuzz_wire.c. */
#ifndef TEST_FUZZ_WIRE_H
#define TEST_FUZZ_WIRE_H

#include <stddef.h>

/* 1: the validator passed the message. */
int fuzz_one(const unsigned char *data, size_t size);
/* A valid message to start from; returns its size. */
size_t fuzz_seed(int k, unsigned char *data, size_t size);

#endif
