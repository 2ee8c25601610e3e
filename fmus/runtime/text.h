/* A growing string. */
#ifndef TEXT_H
#define TEXT_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>

typedef struct {
    char *chars; /* NULL while empty or after memory ran out */
    size_t length;
} Text;

void text_add(Text *text, const char *format, ...);
void text_add_list(Text *text, const char *format, va_list arguments);

/* Adds a string, if it is longer than `most` without lines from its middle: a traceback's end says most. */
void text_add_shortened(Text *text, const char *string, size_t most);
void text_clear(Text *text);
const char *text_of(const Text *text);
char *copy_of(const char *string);
bool is_utf8(const char *string);

#endif
