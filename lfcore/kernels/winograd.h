/* Convolution with 3 x 3 kernels by Winograd's transforms F(4 x 4, 3 x 3) (Lavin and Gray 2016); lfcore.winograd says more.
 *
 * Channels lie in the lanes of a register, so that the transforms are plain arithmetic on registers. Threads take blocks of
 * tiles, small enough that what is between the transforms stays in the nearest caches. winograd.c has it in float32, for
 * registers of eight values, winograd_halved.c in bfloat16, for registers of sixteen and an instruction for products of pairs.
 */
#ifndef LFCORE_KERNELS_WINOGRAD_H
#define LFCORE_KERNELS_WINOGRAD_H

#include "halved.h"
#include "shares.h"
#include "tiled.h"

#define SIZE 6 /* of a tile, px */
#define STEP 4 /* of its result */
#define PLACES (SIZE * SIZE)
#define TILES 24 /* of a block */

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

/* The points of the transforms are 0, +-SMALL, +-1 / SMALL and infinity. */
#define SMALL 0.70710678f
#define LARGE 1.41421356f

/* The transform of six samples, vectors x[0] to x[5], in place. */
#define FORWARD(x)                                                                                                             \
    do {                                                                                                                       \
        const __typeof__((x)[0]) even_ = (x)[4] - 2.0f * (x)[2], odd_ = (x)[3] - 2.0f * (x)[1];                               \
        const __typeof__((x)[0]) far_even_ = (x)[4] - 0.5f * (x)[2], far_odd_ = (x)[3] - 0.5f * (x)[1];                       \
        (x)[0] = (x)[0] + (x)[4] - 2.5f * (x)[2];                                                                              \
        (x)[5] = (x)[1] + (x)[5] - 2.5f * (x)[3];                                                                              \
        (x)[1] = even_ + SMALL * odd_, (x)[2] = even_ - SMALL * odd_;                                                          \
        (x)[3] = far_even_ + LARGE * far_odd_, (x)[4] = far_even_ - LARGE * far_odd_;                                          \
    } while (0)

/* The transform of six products back to four samples, which come first. */
#define BACK(x)                                                                                                                \
    do {                                                                                                                       \
        const __typeof__((x)[0]) sum_ = (x)[1] + (x)[2], difference_ = (x)[1] - (x)[2];                                        \
        const __typeof__((x)[0]) far_sum_ = (x)[3] + (x)[4], far_difference_ = (x)[3] - (x)[4];                                \
        (x)[0] = (x)[0] + sum_ + far_sum_;                                                                                     \
        (x)[1] = SMALL * difference_ + LARGE * far_difference_;                                                                \
        (x)[2] = 0.5f * sum_ + 2.0f * far_sum_;                                                                                \
        (x)[3] = (0.5f * SMALL) * difference_ + (2.0f * LARGE) * far_difference_ + (x)[5];                                     \
    } while (0)

/* Bytes from one of many rows to the next, `least` or more: an odd number of cache lines, so that they do not all fall on the
 * same places of a cache. */
PART Py_ssize_t spaced(Py_ssize_t least) { return 64 * ((least + 63) / 64 | 1); }

/* In winograd_halved.c, where `takes_halves`. Not 0 where there is no memory. */
int winograd_in_halves(const Winograd *w, int threads);

#endif
