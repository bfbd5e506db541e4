/* Level 0: the layout of arrays and the generator of inputs, golden/README.md. */
#include "port.h"

#include <string.h>

void reading(Request *request)
{
    const real *array = in_real(request, "harmonics");
    const uint8_t *mask = in_boolean(request, "mask");
    long count = in_size(request, "harmonics", -1), pixels[2];
    long rows = in_size(request, "harmonics", 0) * in_size(request, "harmonics", 1);
    long gaussian = (long)setting(request, "gaussian"), row = (long)setting(request, "row"), tissue = 0, found = 0;
    pixels[0] = in_size(request, "mask", 0);
    pixels[1] = in_size(request, "mask", 1);
    real *column = out_real(request, "column", rows);
    for (long k = 0; k < rows; k++)
        column[k] = array[k * count + gaussian];
    memcpy(out_real(request, "flat", rows * count), array, (size_t)(rows * count) * sizeof *array);
    *out_real(request, "scalar", 1) = *in_real(request, "scalar");
    out_real(request, "empty", in_size(request, "empty", 0) * in_size(request, "empty", 1));
    for (long p = 0; p < pixels[0] * pixels[1]; p++)
        tissue += mask[p];
    *out_integer(request, "tissue_pixels", 1) = tissue;
    for (long x = 0; x < pixels[1]; x++)
        found += mask[row * pixels[1] + x];
    int64_t *columns = out_integer(request, "tissue_row", found);
    for (long x = 0; x < pixels[1]; x++)
        if (mask[row * pixels[1] + x])
            *columns++ = x;
    real *sample_x = out_real(request, "sample_x", pixels[1]), *sample_y = out_real(request, "sample_y", pixels[0]);
    for (long x = 0; x < pixels[1]; x++)
        sample_x[x] = (real)x + (real)0.5;
    for (long y = 0; y < pixels[0]; y++)
        sample_y[y] = (real)y + (real)0.5;
}

void generator(Request *request)
{
    char text[256];
    uint64_t seed = 0xCBF29CE484222325u;
    long count = (long)setting(request, "count");
    setting_text(request, "seed", text, sizeof text);
    for (const char *byte = text; *byte; byte++)
        seed = (seed ^ (unsigned char)*byte) * 0x100000001B3u;
    uint64_t *words = out_unsigned(request, "words", count);
    real *numbers = out_real(request, "unit_numbers", count);
    for (long k = 0; k < count; k++) {
        uint64_t z = seed + (uint64_t)(k + 1) * 0x9E3779B97F4A7C15u;
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
        z = (z ^ z >> 27) * 0x94D049BB133111EBu;
        words[k] = z ^ z >> 31;
        numbers[k] = (real)((double)(words[k] >> 40) / 16777216.0);
    }
}
