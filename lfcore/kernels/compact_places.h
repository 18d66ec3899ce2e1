/* Where the small pair's inputs are sampled. */
#ifndef LFCORE_KERNELS_COMPACT_PLACES_H
#define LFCORE_KERNELS_COMPACT_PLACES_H

#include "compact.h"

/* Along an axis, where the inputs are sampled: the first pixel of four, and what each counts. */
typedef struct {
    FourWhole first;
    Four taps[4]; /* each of all inputs */
} Places;

/* Places nearer than a pixel to the edge, or not numbers, are moved there: the corners are continued by more than that. */
PART Places inner_places(Four places, Py_ssize_t size, float a) {
    const Four least = {1.0f, 1.0f, 1.0f, 1.0f}, last = (float)(size - 3) * least;
    const FourWhole above = places > least;
    const Four bounded = (Four)(((FourWhole)places & above) | ((FourWhole)least & ~above));
    const FourWhole below = bounded < last;
    const Four inner = (Four)(((FourWhole)bounded & below) | ((FourWhole)last & ~below));
    const FourWhole whole = __builtin_convertvector(inner, FourWhole);
    Places found = {.first = whole - 1};
    cubic_taps_of_four(inner - __builtin_convertvector(whole, Four), a, found.taps);
    return found;
}

#endif
