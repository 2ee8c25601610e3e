#include "text.h"

#include <stdint.h>
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

void text_add_shortened(Text *text, const char *string, size_t most) {
    size_t length = strlen(string), head = most / 3;
    while (length > most && head > 0 && string[head] != '\n') head--;
    const char *tail = length > most ? strchr(string + length - most / 2, '\n') : NULL;
    if (head > 0 && tail)
        text_add(text, "%.*s\n  [...]%s", (int)head, string, tail);
    else
        text_add(text, "%s", string);
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

bool is_utf8(const char *string) {
    const unsigned char *at = (const unsigned char *)string;
    while (*at) {
        unsigned lead = *at++;
        if (lead < 0x80) continue;
        unsigned more = lead >= 0xf0 ? 3 : lead >= 0xe0 ? 2 : 1;
        uint32_t code = lead & (0x3fu >> more);
        if (lead < 0xc2 || lead > 0xf4) return false;
        for (unsigned i = 0; i < more; i++, at++) {
            if ((*at & 0xc0) != 0x80) return false; /* this is also where a string ends too early */
            code = code << 6 | (*at & 0x3fu);
        }
        static const uint32_t least[] = {0, 0x80, 0x800, 0x10000};
        if (code < least[more] || code > 0x10ffff || (code >= 0xd800 && code <= 0xdfff)) return false;
    }
    return true;
}
