/* The module lfcore._kernels. */
#include "common.h"

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
    {"compact_warp", compact_warp, METH_VARARGS, NULL},
    {"compact_blend", compact_blend, METH_VARARGS, NULL},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "lfcore._kernels", "Called through lfcore.kernels alone.", 0, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__kernels(void) { return PyModule_Create(&definition); }
