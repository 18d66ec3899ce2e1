/* What the compiled parts of app.painting share. They are optional: where they are not compiled, shaders do the same.
 *
 * Pictures are rows of pixels of four bytes, the fourth of which does not count.
 */
#ifndef APP_PAINTING_H
#define APP_PAINTING_H

#include "../../lfcore/kernels/common.h"

#define CHANNELS 4

/* What is not a number becomes the least. */
PART float bounded(float value, float least, float most) {
    const float enough = value > least ? value : least;
    return enough < most ? enough : most;
}

/* Whether a buffer holds so many bytes; else an exception is set. */
static inline int holds(const Py_buffer *buffer, Py_ssize_t bytes) {
    if (buffer->len == bytes) return 1;
    PyErr_Format(PyExc_ValueError, "a buffer of %zd bytes was handed over in place of %zd", buffer->len, bytes);
    return 0;
}

#endif
