/* Convolutions that are computed tile by tile between a transform and its inverse: where tiles lie. */
#ifndef LFCORE_KERNELS_TILED_H
#define LFCORE_KERNELS_TILED_H

#include "common.h"

/* The result of a convolution, and the tiles that cover it. */
typedef struct {
    Py_ssize_t height, width;
    Py_ssize_t step; /* pixels that a tile gives along each axis, `dilation` apart */
    Py_ssize_t dilation;
} Tiling;

typedef struct {
    Py_ssize_t top, left;
} Place;

PART Py_ssize_t tiles_along(Py_ssize_t size, const Tiling *t) {
    const Py_ssize_t of_a_phase = (size + t->dilation - 1) / t->dilation;
    return (of_a_phase + t->step - 1) / t->step;
}

PART Py_ssize_t tile_count(const Tiling *t) {
    return t->dilation * t->dilation * tiles_along(t->height, t) * tiles_along(t->width, t);
}

/* Where a tile begins. Pixels `dilation` apart belong together: the tiles of one phase come after those of another. */
PART Place tile_place(const Tiling *t, Py_ssize_t tile) {
    const Py_ssize_t d = t->dilation, columns = tiles_along(t->width, t);
    const Py_ssize_t of_a_phase = tiles_along(t->height, t) * columns, phase = tile / of_a_phase, own = tile % of_a_phase;
    return (Place){phase / d + own / columns * t->step * d, phase % d + own % columns * t->step * d};
}

/* How many pixels of a tile that begins at `place` lie in the result along an axis. */
PART Py_ssize_t pixels_within(const Tiling *t, Py_ssize_t place, Py_ssize_t size) {
    return at_least(at_most(t->step, (size - place + t->dilation - 1) / t->dilation), 0);
}

/* Each `count` channels, as many as lie in a register: `channel` is the first of them. The last ones overlap those before them
 * where the number of channels is not a multiple. */
#define EACH_GROUP(channel, channels, count)                                                                                   \
    for (Py_ssize_t group_ = 0, channel = 0; group_ < (channels) && (channel = at_most(group_, (channels) - (count)), 1);      \
         group_ += (count))

#endif
