/* The module lfcore._kernels. */
#include "common.h"

/* What the module offers; lfcore/kernels/__init__.py says what each does. */
PyObject *plane_sweep(PyObject *module, PyObject *arguments); /* sweep.c */
PyObject *cubic_sample(PyObject *module, PyObject *arguments); /* sample.c */
PyObject *fourier_forward(PyObject *module, PyObject *arguments); /* fourier.c */
PyObject *fourier_backward(PyObject *module, PyObject *arguments); /* fourier.c */
PyObject *winograd_convolution(PyObject *module, PyObject *arguments); /* winograd.c */
PyObject *halves(PyObject *module, PyObject *arguments); /* halved.c */
PyObject *amx(PyObject *module, PyObject *arguments); /* amx.c */
PyObject *amx_products(PyObject *module, PyObject *arguments); /* amx.c */
PyObject *amx_convolution(PyObject *module, PyObject *arguments); /* amx_convolution.c */
PyObject *compact_disparity(PyObject *module, PyObject *arguments); /* compact_disparity.c */
PyObject *compact_align(PyObject *module, PyObject *arguments); /* compact_align.c */
PyObject *compact_warp(PyObject *module, PyObject *arguments); /* compact_warp.c */
PyObject *compact_blend(PyObject *module, PyObject *arguments); /* compact_blend.c */

static PyMethodDef methods[] = {
    {"plane_sweep", plane_sweep, METH_VARARGS, NULL},
    {"cubic_sample", cubic_sample, METH_VARARGS, NULL},
    {"fourier_forward", fourier_forward, METH_VARARGS, NULL},
    {"fourier_backward", fourier_backward, METH_VARARGS, NULL},
    {"winograd_convolution", winograd_convolution, METH_VARARGS, NULL},
    {"halves", halves, METH_NOARGS, NULL},
    {"amx", amx, METH_NOARGS, NULL},
    {"amx_products", amx_products, METH_VARARGS, NULL},
    {"amx_convolution", amx_convolution, METH_VARARGS, NULL},
    {"compact_disparity", compact_disparity, METH_VARARGS, NULL},
    {"compact_align", compact_align, METH_VARARGS, NULL},
    {"compact_warp", compact_warp, METH_VARARGS, NULL},
    {"compact_blend", compact_blend, METH_VARARGS, NULL},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "lfcore._kernels", "Called through lfcore.kernels alone.", 0, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__kernels(void) { return PyModule_Create(&definition); }
