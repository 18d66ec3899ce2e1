#ifndef LFCORE_KERNELS_COMPACT_BLEND_H
#define LFCORE_KERNELS_COMPACT_BLEND_H

#include "compact.h"

#define LOGITS (INPUTS * PHASES)
#define OUTPUTS (LOGITS + 3 * PHASES) /* of the colour network */

typedef struct {
    const void *outputs; /* (height, width, OUTPUTS): logits by input and phase, then the residual by phase and channel */
    const void *straight; /* (height, width, 3 * PHASES): more of the residual */
    int halved;
    const void *warped; /* (height, width, PHASES, INPUTS, 4) */
    int shortened; /* whether warped is; the rest is halved then */
    const float *nearness; /* (INPUTS): added to the logits */
    Py_ssize_t height, width;
    float middle, weight, toe; /* what was taken off the warped inputs, what the residual counts, of the root tone */
    float *picture; /* (picture_height, picture_width, 3), stored values */
    Py_ssize_t picture_height, picture_width; /* at most twice the pixels */
} Blend;

/* Rows `begin` to `end` where `warped` is shortened and `takes_halves` (compact_blend_halved.c). */
void blend_rows_in_halves(const Blend *b, Py_ssize_t begin, Py_ssize_t end);

#endif
