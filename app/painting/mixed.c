/* The cross-fade between two pictures: shaders/fade.frag for the processor. */
#include "painting.h"

#define WHOLE 256 /* a share of one */

MANY_PROCESSORS
static void mix(const uint8_t *restrict before, const uint8_t *restrict after, uint32_t share, uint8_t *restrict out,
                Py_ssize_t count) {
    for (Py_ssize_t i = 0; i < count; ++i)
        out[i] = (uint8_t)((before[i] * (WHOLE - share) + after[i] * share + WHOLE / 2) / WHOLE);
}

PyObject *mixed(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Py_buffer before, after, out;
    float share;
    if (!PyArg_ParseTuple(arguments, "y*y*fw*", &before, &after, &share, &out)) return NULL;
    const int right = holds(&before, out.len) && holds(&after, out.len);
    const float kept = share > 0.0f ? share : 0.0f;
    const uint32_t whole_share = (uint32_t)((kept < 1.0f ? kept : 1.0f) * WHOLE + 0.5f);
    if (right) {
        Py_BEGIN_ALLOW_THREADS
        mix(before.buf, after.buf, whole_share, out.buf, out.len);
        Py_END_ALLOW_THREADS
    }
    PyBuffer_Release(&before);
    PyBuffer_Release(&after);
    PyBuffer_Release(&out);
    if (!right) return NULL;
    Py_RETURN_NONE;
}
