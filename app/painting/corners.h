/* What triangles.c and marked.c are handed: triangles as imgui lays them out. */
#ifndef APP_PAINTING_CORNERS_H
#define APP_PAINTING_CORNERS_H

#include "painting.h"

/* The colour red first, its last byte how much it covers. */
typedef struct {
    float x, y, u, v;
    uint32_t colour;
} Corner;

/* Whole pixels; right and bottom lie outside. */
typedef struct {
    Py_ssize_t left, top, right, bottom;
} Box;

#define FARTHEST 1000000.0f /* px: nothing that is seen lies there, and products of places fit into 64 bits */

PART float least_of(float a, float b, float c) { return a < b ? (a < c ? a : c) : (b < c ? b : c); }
PART float most_of(float a, float b, float c) { return a > b ? (a > c ? a : c) : (b > c ? b : c); }

/* Where a triangle is painted at most: a pixel more than it reaches on either side, for painting rounds. */
PART Box bounds_of(const Corner *a, const Corner *b, const Corner *c) {
    const float left = bounded(least_of(a->x, b->x, c->x), -FARTHEST, FARTHEST);
    const float right = bounded(most_of(a->x, b->x, c->x), -FARTHEST, FARTHEST);
    const float top = bounded(least_of(a->y, b->y, c->y), -FARTHEST, FARTHEST);
    const float bottom = bounded(most_of(a->y, b->y, c->y), -FARTHEST, FARTHEST);
    return (Box){(Py_ssize_t)left - 1, (Py_ssize_t)top - 1, (Py_ssize_t)right + 2, (Py_ssize_t)bottom + 2};
}

/* What two boxes share; where that is nothing, a side of it lies beyond the opposite one or on it. */
PART Box shared_by(Box a, Box b) {
    return (Box){at_least(a.left, b.left), at_least(a.top, b.top), at_most(a.right, b.right), at_most(a.bottom, b.bottom)};
}

PART int holds_pixels(Box box) { return box.left < box.right && box.top < box.bottom; }

/* Whether there are that many corners; else an exception is set. triangles.c */
int lie_among(const uint32_t *indices, Py_ssize_t count, Py_ssize_t corners);

#endif
