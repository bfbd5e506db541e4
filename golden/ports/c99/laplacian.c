/* The Laplacian detail loss, equation (5), and the calibration of its weight, equation (7). */
#include "port.h"

#include <stdlib.h>
#include <string.h>

enum { TAPS = 5, MOST_LEVELS = 8 };
static const double BINOMIAL[TAPS] = {1.0 / 16, 4.0 / 16, 6.0 / 16, 4.0 / 16, 1.0 / 16};

typedef struct {
    long height, width;
} Size;

static Size halved(Size size) { return (Size){(size.height + 1) / 2, (size.width + 1) / 2}; }
static long area(Size size) { return size.height * size.width; }
static long smaller(long a, long b) { return a < b ? a : b; }

/* Reflection that does not repeat the edge sample. */
static long reflected(long k, long n)
{
    long period = 2 * (n - 1);
    if (n == 1)
        return 0;
    k = ((k % period) + period) % period;
    return k < n ? k : period - k;
}

/* The two coarse samples of a fine one, with their weights; co-sited even samples have only one. */
static void parents(long fine, long coarse, bool co_sited, long at[2], real weight[2])
{
    long k = fine / 2;
    at[0] = k;
    at[1] = fine % 2 || co_sited ? smaller(k + 1, coarse - 1) : (k > 0 ? k - 1 : 0);
    weight[0] = co_sited ? (fine % 2 ? (real)0.5 : 1) : (real)0.75;
    weight[1] = 1 - weight[0];
}

/* coarse = D fine, or, in reverse, fine += D' coarse. */
static void down(real *fine, real *coarse, Size size, bool reverse)
{
    Size half = halved(size);
    for (long y = 0; y < half.height; y++)
        for (long x = 0; x < half.width; x++)
            for (long r = 0; r < TAPS; r++)
                for (long s = 0; s < TAPS; s++) {
                    long at = reflected(2 * y + r - 2, size.height) * size.width + reflected(2 * x + s - 2, size.width);
                    real weight = (real)(BINOMIAL[r] * BINOMIAL[s]);
                    if (reverse)
                        fine[at] += weight * coarse[y * half.width + x];
                    else
                        coarse[y * half.width + x] += weight * fine[at];
                }
}

/* fine -= U coarse, or, in reverse, coarse -= U' fine. */
static void up(real *fine, real *coarse, Size size, bool co_sited, bool reverse)
{
    Size half = halved(size);
    for (long y = 0; y < size.height; y++)
        for (long x = 0; x < size.width; x++) {
            long rows[2], columns[2];
            real wy[2], wx[2];
            parents(y, half.height, co_sited, rows, wy);
            parents(x, half.width, co_sited, columns, wx);
            for (int k = 0; k < 4; k++) {
                real weight = wy[k / 2] * wx[k % 2], *far = &coarse[rows[k / 2] * half.width + columns[k % 2]];
                real *near = &fine[y * size.width + x];
                if (reverse)
                    *far -= weight * *near;
                else
                    *near -= weight * *far;
            }
        }
}

/* Tissue of the next level: True where the whole filter stands on tissue. */
static void down_mask(const uint8_t *fine, uint8_t *coarse, Size size)
{
    Size half = halved(size);
    for (long y = 0; y < half.height; y++)
        for (long x = 0; x < half.width; x++) {
            uint8_t all = 1;
            for (long r = -2; r <= 2; r++)
                for (long s = -2; s <= 2; s++)
                    all &= fine[reflected(2 * y + r, size.height) * size.width + reflected(2 * x + s, size.width)];
            coarse[y * half.width + x] = all;
        }
}

/* Valid band values; returns how many. */
static long valid_mask(const uint8_t *fine, const uint8_t *coarse, Size size, bool co_sited, uint8_t *valid)
{
    long width = halved(size).width, count = 0;
    for (long y = 0; y < size.height; y++)
        for (long x = 0; x < size.width; x++) {
            long rows[2], columns[2];
            real wy[2], wx[2];
            uint8_t all = fine[y * size.width + x];
            parents(y, halved(size).height, co_sited, rows, wy);
            parents(x, width, co_sited, columns, wx);
            for (int k = 0; k < 4; k++)
                if (wy[k / 2] * wx[k % 2] != 0)
                    all &= coarse[rows[k / 2] * width + columns[k % 2]];
            valid[y * size.width + x] = all;
            count += all;
        }
    return count;
}

/* bands[j] of size sizes[j]; image is level 0. The bands are freed by the caller. */
static void pyramid(const real *image, const Size *sizes, int levels, bool co_sited, real **bands)
{
    real *fine = zeros(area(sizes[0]), sizeof *fine);
    memcpy(fine, image, (size_t)area(sizes[0]) * sizeof *fine);
    for (int j = 0; j < levels; j++) {
        real *coarse = zeros(area(sizes[j + 1]), sizeof *coarse);
        down(fine, coarse, sizes[j], false);
        up(fine, coarse, sizes[j], co_sited, false);
        bands[j] = fine;
        fine = coarse;
    }
    free(fine);
}

/* The gradient of one channel from those of its bands, which are changed on the way. */
static void pyramid_reverse(real **d_bands, const Size *sizes, int levels, bool co_sited, real *d_image)
{
    real *d_coarse = NULL;
    for (int j = levels - 1; j >= 0; j--) { /* d_coarse: the gradient of the level below band j */
        if (!d_coarse)
            d_coarse = zeros(area(sizes[j + 1]), sizeof *d_coarse);
        up(d_bands[j], d_coarse, sizes[j], co_sited, true);
        down(d_bands[j], d_coarse, sizes[j], true);
        free(d_coarse);
        d_coarse = d_bands[j];
        d_bands[j] = NULL;
    }
    memcpy(d_image, d_coarse, (size_t)area(sizes[0]) * sizeof *d_image);
    free(d_coarse);
}

/* Loss of one channel; its bands become their own gradients. */
static double band_loss(real **bands, uint8_t **valid, const long *counts, const Size *sizes, int levels, double d_loss)
{
    double loss = 0.0;
    for (int j = 0; j < levels; j++)
        for (long p = 0; p < area(sizes[j]); p++) {
            real value = bands[j][p];
            bool counted = valid[j][p] && value != 0;
            double share = counted ? 1.0 / (3.0 * levels * (double)counts[j]) : 0.0;
            loss += share * fabs((double)value);
            bands[j][p] = (real)(value > 0 ? share * d_loss : -share * d_loss);
        }
    return loss;
}

/* valid_1 .. and how many of each; the supports are freed here. */
static void supports(Request *request, const Size *sizes, int levels, bool co_sited, uint8_t **valid, long *counts)
{
    uint8_t *fine = zeros(area(sizes[0]), 1);
    memcpy(fine, in_boolean(request, "mask"), (size_t)area(sizes[0]));
    for (int j = 0; j < levels; j++) {
        char name[] = "valid_1";
        name[6] = (char)('1' + j);
        uint8_t *coarse = zeros(area(sizes[j + 1]), 1);
        valid[j] = out_boolean(request, name, area(sizes[j]));
        down_mask(fine, coarse, sizes[j]);
        counts[j] = valid_mask(fine, coarse, sizes[j], co_sited, valid[j]);
        free(fine);
        fine = coarse;
    }
    free(fine);
}

void laplacian(Request *request)
{
    const real *rendered = in_real(request, "rendered"), *observed = in_real(request, "observed");
    const uint8_t *mask = in_boolean(request, "mask");
    int levels = (int)setting(request, "levels");
    bool co_sited = setting_is(request, "upsampling", "co_sited");
    double d_loss = *in_real(request, "d_loss"), loss = 0.0;
    Size sizes[MOST_LEVELS + 1] = {{in_size(request, "mask", 0), in_size(request, "mask", 1)}};
    uint8_t *valid[MOST_LEVELS];
    real *bands[MOST_LEVELS], *shown[MOST_LEVELS];
    long counts[MOST_LEVELS], pixels = area(sizes[0]);
    for (int j = 0; j < levels; j++) {
        char name[] = "band_1";
        name[5] = (char)('1' + j);
        sizes[j + 1] = halved(sizes[j]);
        shown[j] = out_real(request, name, 3 * area(sizes[j]));
    }
    supports(request, sizes, levels, co_sited, valid, counts);
    real *d_rendered = out_real(request, "d_rendered", 3 * pixels), *difference = scratch(request, pixels);
    for (long channel = 0; channel < 3; channel++) {
        pyramid(observed + channel * pixels, sizes, levels, co_sited, bands);
        for (int j = 0; j < levels; j++) {
            memcpy(shown[j] + channel * area(sizes[j]), bands[j], (size_t)area(sizes[j]) * sizeof(real));
            free(bands[j]);
        }
        for (long p = 0; p < pixels; p++) /* the pyramid is linear: one of the difference is enough */
            difference[p] = mask[p] ? rendered[channel * pixels + p] - observed[channel * pixels + p] : 0;
        pyramid(difference, sizes, levels, co_sited, bands);
        loss += band_loss(bands, valid, counts, sizes, levels, d_loss);
        pyramid_reverse(bands, sizes, levels, co_sited, d_rendered + channel * pixels);
    }
    *out_real(request, "loss", 1) = (real)loss;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double rms(const real *values, long count)
{
    double sum = 0.0;
    for (long k = 0; k < count; k++)
        sum += (double)values[k] * values[k];
    return sqrt(sum / (double)count);
}

void calibration(Request *request)
{
    const real *photometric = in_real(request, "d_photometric"), *detail = in_real(request, "d_laplacian");
    long views = in_size(request, "d_photometric", 0), entries = 1, kept = 0;
    for (int axis = 1; axis <= 3; axis++)
        entries *= in_size(request, "d_photometric", axis);
    real *g_rgb = out_real(request, "g_rgb", views), *g_lap = out_real(request, "g_lap", views);
    double *ratios = zeros(views, sizeof *ratios);
    for (long v = 0; v < views; v++) {
        double rgb = rms(photometric + v * entries, entries), lap = rms(detail + v * entries, entries);
        g_rgb[v] = (real)rgb;
        g_lap[v] = (real)lap;
        if (rgb > 0.0 && isfinite(lap / rgb))
            ratios[kept++] = lap / rgb;
    }
    qsort(ratios, (size_t)kept, sizeof *ratios, ascending);
    double median = kept ? (ratios[(kept - 1) / 2] + ratios[kept / 2]) / 2.0 : 0.0;
    free(ratios);
    *out_boolean(request, "refused", 1) = median == 0.0;
    *out_real(request, "lambda_lap", 1) = (real)(median == 0.0 ? 0.0 : setting(request, "gradient_ratio") / median);
}
