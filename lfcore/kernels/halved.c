#include "halved.h"

#ifdef HALVED_COMPILED

int takes_halves(void) {
    return __builtin_cpu_supports("avx512bf16") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") &&
           __builtin_cpu_supports("avx512dq");
}

__attribute__((HALVED)) void halved_products(
    const uint16_t *rows, Py_ssize_t count, Py_ssize_t pairs, const uint16_t *matrix, Py_ssize_t groups, const float *bias,
    float *out) {
    all_products(rows, count, pairs, matrix, groups, bias, out, groups * COLUMNS);
}

#else

int takes_halves(void) { return 0; }
void halved_products(const uint16_t *Py_UNUSED(rows), Py_ssize_t Py_UNUSED(count), Py_ssize_t Py_UNUSED(pairs),
                     const uint16_t *Py_UNUSED(matrix), Py_ssize_t Py_UNUSED(groups), const float *Py_UNUSED(bias),
                     float *Py_UNUSED(out)) {}

#endif

PyObject *halves(PyObject *Py_UNUSED(module), PyObject *Py_UNUSED(arguments)) { return PyBool_FromLong(takes_halves()); }
