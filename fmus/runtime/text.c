#include "text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void text_add_list(Text *text, const char *format, va_list arguments) {
    va_list again;
    va_copy(again, arguments);
    int more = vsnprintf(NULL, 0, format, again);
    va_end(again);
    if (more < 0) return;
    char *grown = realloc(text->chars, text->length + (size_t)more + 1);
    if (!grown) return;
    text->chars = grown;
    vsnprintf(grown + text->length, (size_t)more + 1, format, arguments);
    text->length += (size_t)more;
}

void text_add(Text *text, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    text_add_list(text, format, arguments);
    va_end(arguments);
}

void text_clear(Text *text) {
    free(text->chars);
    *text = (Text){0};
}

const char *text_of(const Text *text) { return text->chars ? text->chars : ""; }

char *copy_of(const char *string) {
    size_t size = strlen(string) + 1;
    char *copy = malloc(size);
    return copy ? memcpy(copy, string, size) : NULL;
}
