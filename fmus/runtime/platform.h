/* What differs between the operating systems. All strings are UTF-8; those returned as `char *` are the caller's. */
#ifndef PLATFORM_H
#define PLATFORM_H

#include <stdbool.h>

#include "text.h"

#ifdef _WIN32
#define PYTHON_ON_PATH "python" /* Python's installer makes no python3 there */
#else
#define PYTHON_ON_PATH "python3"
#endif

typedef void (*AnyFunction)(void);

/* Loads a shared library whose symbols what is loaded later sees; on failure returns NULL and adds why to `fault`. */
void *platform_open_library(const char *path, Text *fault);
void platform_close_library(void *library);
AnyFunction platform_function(void *library, const char *name);

/* The module of this process that holds a Python interpreter, or NULL. */
void *platform_loaded_python(void);

char *platform_environment(const char *name);
bool platform_exists(const char *path);
char *platform_real_path(const char *path); /* behind symbolic links, or NULL */
/* Lets a program be executed: tools that unpack an FMU may lose that. On failure adds why to `fault`. */
bool platform_make_executable(const char *path, Text *fault);
char *platform_read_file(const char *path);

/* What `interpreter script` writes to its standard output, or NULL if it could not be run or failed. */
char *platform_run(const char *interpreter, const char *script);

/* The native path of an FMU's resources from a file URI or a path, without a separator at its end. */
char *platform_path(const char *uri_or_path);

#endif
