/* .npy files: a magic word, a header in plain text, then the numbers, little-endian and row-major.
 *
 * The machine must be little-endian itself.
 */
#include "port.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST_HEADER = 4096 };

static void read_shape(const char *text, Array *array)
{
    array->rank = 0;
    array->count = 1;
    while (*text && *text != ')') {
        if (*text < '0' || *text > '9') {
            text++;
            continue;
        }
        char *end;
        if (array->rank == MOST_AXES)
            fail("%s: too many axes", array->name);
        array->shape[array->rank] = strtol(text, &end, 10);
        array->count *= array->shape[array->rank++];
        text = end;
    }
}

/* Reals arrive as float64 and are kept as `real`: exact, because every real input is a float32 number. */
static void read_numbers(FILE *file, Array *array)
{
    size_t count = (size_t)array->count;
    if (array->kind == 'f') {
        double *raw = zeros(array->count, sizeof *raw);
        real *kept = array->data = zeros(array->count, sizeof *kept);
        if (fread(raw, sizeof *raw, count, file) != count)
            fail("%s: too short", array->name);
        for (size_t k = 0; k < count; k++)
            kept[k] = (real)raw[k];
        free(raw);
        return;
    }
    size_t size = array->kind == 'b' ? 1 : 8;
    array->data = zeros(array->count, size);
    if (fread(array->data, size, count, file) != count)
        fail("%s: too short", array->name);
}

void npy_read(const char *path, Array *array)
{
    FILE *file = fopen(path, "rb");
    unsigned char start[10];
    char header[LONGEST_HEADER + 1];
    if (!file || fread(start, 1, 10, file) != 10 || memcmp(start, "\x93NUMPY\x01", 7) != 0)
        fail("%s: not a .npy file of version 1", path);
    size_t length = start[8] + 256u * start[9];
    if (length > LONGEST_HEADER || fread(header, 1, length, file) != length)
        fail("%s: bad header", path);
    header[length] = 0;
    const char *type = strstr(header, "'descr': '"), *shape = strstr(header, "'shape': (");
    if (!type || !shape || !strstr(header, "'fortran_order': False"))
        fail("%s: bad header", path);
    array->kind = type[11];
    if (strncmp(type + 10, "<f8", 3) && strncmp(type + 10, "<i8", 3) && strncmp(type + 10, "|b1", 3))
        fail("%s: bad type", path);
    read_shape(shape + 10, array);
    read_numbers(file, array);
    fclose(file);
}

void npy_write(const char *path, const Array *array)
{
    size_t size = array->kind == 'f' ? sizeof(real) : array->kind == 'b' ? 1 : 8;
    char shape[24 * MOST_AXES] = "", header[LONGEST_HEADER];
    for (int k = 0; k < array->rank; k++)
        sprintf(shape + strlen(shape), "%ld%s", array->shape[k], k + 1 < array->rank ? ", " : "");
    int length = sprintf(header, "{'descr': '%c%c%d', 'fortran_order': False, 'shape': (%s%s), }",
                         size == 1 ? '|' : '<', array->kind, (int)size, shape, array->rank == 1 ? "," : "");
    while ((10 + length + 1) % 64)
        header[length++] = ' ';
    header[length++] = '\n';
    const unsigned char start[10] = {0x93, 'N', 'U', 'M', 'P', 'Y', 1, 0,
                                     (unsigned char)(length % 256), (unsigned char)(length / 256)};
    FILE *file = fopen(path, "wb");
    if (!file)
        fail("%s: cannot be written", path);
    size_t count = (size_t)array->count;
    if (fwrite(start, 1, 10, file) != 10 || fwrite(header, 1, (size_t)length, file) != (size_t)length
        || fwrite(array->data, size, count, file) != count || fclose(file) != 0)
        fail("%s: cannot be written", path);
}
