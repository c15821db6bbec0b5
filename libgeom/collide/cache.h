/* cache.h: what a pair remembers of its last meeting. */
#ifndef CRM_CACHE_H
#define CRM_CACHE_H

#include "collide/closest.h"

/* 1: the cores are still apart by more than reach; *gap is a lower bound of their distance. */
int crm_still_beyond(const carom_frame *a, const carom_frame *b, double reach,
                     const carom_pair_cache *cache, double *gap);

/* Closest features of two placed shapes, not both points, with the help of the cache. */
void crm_closest_cached(const crm_placed *a, const crm_placed *b, double reach,
                        carom_pair_cache *cache, crm_closest *out);

#endif
