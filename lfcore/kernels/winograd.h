/* Convolution with 3 x 3 kernels by Winograd's transforms (Lavin and Gray 2016); lfcore.winograd says more.
 *
 * Channels lie in the lanes of a register, so that the transforms are plain arithmetic on registers. Threads take blocks of
 * tiles, small enough that what is between the transforms stays in the nearest caches. winograd.c has it in float32, for
 * registers of eight values, by F(6 x 6, 3 x 3); winograd_halved.c in bfloat16, for registers of sixteen and an instruction for
 * products of pairs, by F(4 x 4, 3 x 3). Both define SIZE and STEP, the sizes of a tile and of its result, px, and PLACES.
 */
#ifndef LFCORE_KERNELS_WINOGRAD_H
#define LFCORE_KERNELS_WINOGRAD_H

#include "halved.h"
#include "tiled.h"

typedef struct {
    Tiling tiling; /* of the result */
    const void *in; /* (height, width, channels) */
    Py_ssize_t height, width, channels;
    Py_ssize_t padding; /* px of zeros around it */
    int of_positive; /* whether negative values of it count as 0 */
    const void *weights; /* (PLACES, groups, channels, COLUMNS), in bfloat16 (PLACES, groups, pairs, COLUMNS, 2) */
    Py_ssize_t groups;
    const float *bias; /* (outputs) */
    const void *added; /* to the result, a picture like it, or NULL */
    void *out; /* (result height, result width, outputs) */
    Py_ssize_t outputs;
    int positive; /* whether negative values of the result become 0 */
} Winograd;

/* Bytes from one of many rows to the next, `least` or more: an odd number of cache lines, so that they do not all fall on the
 * same places of a cache. */
PART Py_ssize_t spaced(Py_ssize_t least) { return 64 * ((least + 63) / 64 | 1); }

/* In winograd_halved.c, where `takes_halves`. Sets the tiling's step. Not 0 where there is no memory. */
int winograd_in_halves(Winograd *w, int threads);

#endif
