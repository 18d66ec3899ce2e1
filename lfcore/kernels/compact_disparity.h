#ifndef LFCORE_KERNELS_COMPACT_DISPARITY_H
#define LFCORE_KERNELS_COMPACT_DISPARITY_H

#include "amx.h"
#include "compact.h"

#define NEIGHBOURS 9
#define SPREAD 48 /* four weights for each neighbour, filled up to whole registers */
#define BOX 2 /* how far the deviation around a pixel reaches */

/* A matrix and a bias, by which the channels of pixels are multiplied. */
typedef struct {
    const float *weights; /* (channels, outputs), outputs a multiple of 16 */
    const uint16_t *halved; /* the same as `halved_products` wants it, or NULL where that is not to be used */
    const void *packed; /* the same for the matrix unit, or NULL where that is not to be used */
    const float *bias; /* (outputs) */
} Matrix;

typedef struct {
    const void *pixels; /* (height, width, channels), not negative */
    const void *deviations; /* (height, width, levels): of the sweep */
    int halved;
    Py_ssize_t height, width, channels, levels, outputs; /* outputs: the levels, filled up to a multiple of 16 */
    Matrix score; /* what is filled up is never to be chosen */
    const float *values; /* (outputs), px */
    Matrix spread; /* its SPREAD outputs by neighbour, then phase */
    float sharpness; /* how steeply a level's score falls with its deviation */
    float *coarse; /* (height, width), px */
    float *disparity; /* (PHASES, height, width), px */
    int wide; /* whether what follows the products is for sixteen values at a time: halved, and `takes_halves` */
} Disparity;

/* Floats of the room that `sum_rows` and `coarse_from_scores` need for sums, and `phases_from_scores` for coarse disparities. */
PART Py_ssize_t room_for_sums(const Disparity *d) { return (d->width + 2 * BOX) * d->outputs; }
PART Py_ssize_t room_for_coarse(const Disparity *d) { return 3 * (d->width + 2) + 2; }

/* What follows the products of row y, where d->wide (compact_disparity_halved.c). scores: (width, outputs), which are changed, or
 * (width, SPREAD). */
void coarse_of_sixteens(const Disparity *d, Py_ssize_t y, float *sums, float *scores);
void phases_of_sixteens(const Disparity *d, Py_ssize_t y, const float *scores, float *coarse);

#endif
