#ifndef LFCORE_KERNELS_COMPACT_WARP_H
#define LFCORE_KERNELS_COMPACT_WARP_H

#include "compact.h"

#define GATHERED 64 /* channels that the colour network takes */

typedef struct {
    const void *corners; /* (INPUTS, source_height, source_width, 4): three channels and one unused */
    Py_ssize_t source_height, source_width;
    const float *disparity; /* (PHASES, height, width), px */
    const float *offsets; /* (2, INPUTS): what disparity moves the place of sampling by, along x, then y */
    const float *moves; /* (2, INPUTS): by what it is moved anyhow, px */
    Py_ssize_t height, width, reach; /* reach: of the whole picture's first pixel from the corners' edges, px */
    float a; /* of the cubic kernel */
    float u, v; /* as the colour network takes them */
    void *gathered; /* (height, width, GATHERED) */
    int halved;
    void *warped; /* (height, width, PHASES, INPUTS, 4) */
    int shortened; /* whether corners and warped are */
} Warp;

/* Rows `begin` to `end` of a warp that is shortened and halved, where `takes_halves` (compact_warp_halved.c). Not 0 where there is
 * no memory. */
int warp_rows_in_halves(const Warp *warp, Py_ssize_t begin, Py_ssize_t end);

/* The least or greatest (with its sign turned) disparity of the three rows around y, by column. */
PART void widest_of_rows(const Warp *warp, Py_ssize_t y, float sign, float *restrict widest) {
    const Py_ssize_t w = warp->width;
    for (Py_ssize_t x = 0; x < w; ++x) widest[x] = -INFINITY;
    for (Py_ssize_t near = at_least(y - 1, 0); near <= at_most(y + 1, warp->height - 1); ++near)
        for (int phase = 0; phase < PHASES; ++phase) {
            const float *restrict row = warp->disparity + (phase * warp->height + near) * w;
            for (Py_ssize_t x = 0; x < w; ++x) widest[x] = sign * row[x] > widest[x] ? sign * row[x] : widest[x];
        }
}

/* What `spread_at` needs of row y. widest: (2, width). */
PART void spreads_of_row(const Warp *warp, Py_ssize_t y, float *restrict widest) {
    widest_of_rows(warp, y, 1.0f, widest);
    widest_of_rows(warp, y, -1.0f, widest + warp->width);
}

PART float widest_around(const float *widest, Py_ssize_t x, Py_ssize_t width) {
    const float left = widest[within(x - 1, width)], right = widest[within(x + 1, width)];
    const float sides = left > right ? left : right;
    return sides > widest[x] ? sides : widest[x];
}

/* How far disparities spread around a pixel of the row, px. */
PART float spread_at(const float *widest, Py_ssize_t x, Py_ssize_t width) {
    return widest_around(widest, x, width) + widest_around(widest + width, x, width);
}

#endif
