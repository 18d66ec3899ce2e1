/* A picture of numbers in 8 bits, as lfcore.metrics.to_uint8 has it, with a fourth value of 255 a pixel. */
#include "painting.h"

MANY_PROCESSORS
static void to_bytes(const float *restrict image, uint8_t *restrict out, Py_ssize_t pixels) {
    for (Py_ssize_t i = 0; i < pixels; ++i) {
        for (int k = 0; k < 3; ++k) out[CHANNELS * i + k] = (uint8_t)(int32_t)(bounded(image[3 * i + k], 0.0f, 1.0f) * 255.0f + 0.5f);
        out[CHANNELS * i + 3] = 255;
    }
}

PyObject *in_bytes(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Py_buffer image, out;
    if (!PyArg_ParseTuple(arguments, "y*w*", &image, &out)) return NULL;
    const Py_ssize_t pixels = out.len / CHANNELS;
    const int right = holds(&out, pixels * CHANNELS) && holds(&image, pixels * 3 * (Py_ssize_t)sizeof(float));
    if (right) {
        Py_BEGIN_ALLOW_THREADS
        to_bytes(image.buf, out.buf, pixels);
        Py_END_ALLOW_THREADS
    }
    PyBuffer_Release(&image);
    PyBuffer_Release(&out);
    if (!right) return NULL;
    Py_RETURN_NONE;
}
