#include "port.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

void fail(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fputs("port: ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    exit(1);
}

void *zeros(long count, size_t size)
{
    void *memory = calloc(count > 0 ? (size_t)count : 1, size);
    if (!memory)
        fail("out of memory");
    return memory;
}

char *read_text(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (!file)
        fail("%s: cannot be opened", path);
    fseek(file, 0, SEEK_END);
    long length = ftell(file);
    rewind(file);
    char *text = zeros(length + 1, 1);
    if (fread(text, 1, (size_t)length, file) != (size_t)length)
        fail("%s: cannot be read", path);
    fclose(file);
    return text;
}
