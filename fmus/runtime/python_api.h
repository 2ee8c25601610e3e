/* The Python interpreter of this process, found at run time: no headers of Python, no link to it.
 *
 * Only functions of the stable ABI are used, so one binary serves every Python from 3.10 on.
 */
#ifndef PYTHON_API_H
#define PYTHON_API_H

#include <stdbool.h>
#include <stddef.h>
#include <wchar.h>

#include "text.h"

typedef struct PyObject PyObject;
typedef ptrdiff_t Py_ssize_t;

#define PYTHON_FUNCTIONS(F)                                                   \
    F(int, Py_IsInitialized, (void))                                          \
    F(void, Py_InitializeEx, (int))                                           \
    F(const char *, Py_GetVersion, (void))                                    \
    F(wchar_t *, Py_DecodeLocale, (const char *, size_t *))                   \
    F(void *, PyEval_SaveThread, (void))                                      \
    F(int, PyGILState_Ensure, (void))                                         \
    F(void, PyGILState_Release, (int))                                        \
    F(void, Py_IncRef, (PyObject *))                                          \
    F(void, Py_DecRef, (PyObject *))                                          \
    F(void, PyErr_Fetch, (PyObject **, PyObject **, PyObject **))             \
    F(void, PyErr_NormalizeException, (PyObject **, PyObject **, PyObject **)) \
    F(void, PyErr_Clear, (void))                                              \
    F(PyObject *, PyErr_NoMemory, (void))                                     \
    F(int, PyException_SetTraceback, (PyObject *, PyObject *))                \
    F(PyObject *, PyObject_GetAttrString, (PyObject *, const char *))         \
    F(int, PyObject_IsTrue, (PyObject *))                                     \
    F(PyObject *, PyObject_CallNoArgs, (PyObject *))                          \
    F(PyObject *, PyObject_CallFunctionObjArgs, (PyObject *, ...))            \
    F(PyObject *, PyObject_Str, (PyObject *))                                 \
    F(PyObject *, PyDict_New, (void))                                         \
    F(PyObject *, PyDict_GetItemString, (PyObject *, const char *))           \
    F(int, PyDict_SetItemString, (PyObject *, const char *, PyObject *))      \
    F(PyObject *, PyImport_AddModule, (const char *))                         \
    F(PyObject *, PyModule_GetDict, (PyObject *))                             \
    F(PyObject *, PyLong_FromSize_t, (size_t))                                \
    F(PyObject *, PyUnicode_FromString, (const char *))                       \
    F(PyObject *, PyUnicode_AsUTF8String, (PyObject *))                       \
    F(PyObject *, PyBytes_FromStringAndSize, (const char *, Py_ssize_t))      \
    F(int, PyBytes_AsStringAndSize, (PyObject *, char **, Py_ssize_t *))      \
    F(PyObject *, Py_CompileString, (const char *, const char *, int))        \
    F(PyObject *, PyEval_EvalCode, (PyObject *, PyObject *, PyObject *))

typedef struct {
#define FIELD(Result, name, Arguments) Result(*name) Arguments;
    PYTHON_FUNCTIONS(FIELD)
#undef FIELD
} PythonApi;

extern PythonApi py; /* filled by python_attach */

/* Makes `py` usable and the interpreter run. On failure `tried` says what was tried, and the remedy. */
bool python_attach(const char *resources, Text *tried);

/* The path of the interpreter that resources/python.txt notes, or NULL. */
char *python_noted(const char *resources);

#endif
