/* The module app.painting._painting. */
#include "painting.h"

/* What the module offers; __init__.py says what each does. */
PyObject *carried(PyObject *module, PyObject *arguments); /* carried.c */
PyObject *spread(PyObject *module, PyObject *arguments); /* carried.c */
PyObject *in_bytes(PyObject *module, PyObject *arguments); /* in_bytes.c */
PyObject *mixed(PyObject *module, PyObject *arguments); /* mixed.c */
PyObject *enlarged(PyObject *module, PyObject *arguments); /* enlarged.c */
PyObject *triangles(PyObject *module, PyObject *arguments); /* triangles.c */
PyObject *marked(PyObject *module, PyObject *arguments); /* marked.c */

static PyMethodDef methods[] = {
    {"carried", carried, METH_VARARGS, NULL},
    {"spread", spread, METH_VARARGS, NULL},
    {"in_bytes", in_bytes, METH_VARARGS, NULL},
    {"mixed", mixed, METH_VARARGS, NULL},
    {"enlarged", enlarged, METH_VARARGS, NULL},
    {"triangles", triangles, METH_VARARGS, NULL},
    {"marked", marked, METH_VARARGS, NULL},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "app.painting._painting", "Called through app.painting alone.", 0, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__painting(void) { return PyModule_Create(&definition); }
