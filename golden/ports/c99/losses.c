/* Losses of an image and of a depth: L1 (B6), SSIM (B7), normalised depth (B8), smoothness (B9). */
#include "port.h"

#include <stdlib.h>

enum { RADIUS = 5, FEWEST_PRIORS = 10 };

static long count_of(const uint8_t *mask, long pixels)
{
    long count = 0;
    for (long p = 0; p < pixels; p++)
        count += mask[p];
    return count;
}

static int sign_of(double value) { return (value > 0) - (value < 0); }

void masked_l1(Request *request)
{
    const real *rendered = in_real(request, "rendered"), *observed = in_real(request, "observed");
    const uint8_t *mask = in_boolean(request, "mask");
    long pixels = in_size(request, "mask", 0) * in_size(request, "mask", 1), count = 3 * count_of(mask, pixels);
    double d_loss = *in_real(request, "d_loss"), loss = 0.0;
    real *d_rendered = out_real(request, "d_rendered", 3 * pixels);
    for (long p = 0; p < 3 * pixels; p++) {
        if (!mask[p % pixels])
            continue;
        real difference = rendered[p] - observed[p];
        loss += fabs((double)difference) / (double)count;
        d_rendered[p] = (real)(sign_of(difference) * d_loss / (double)count);
    }
    *out_real(request, "loss", 1) = (real)loss;
}

/* The image under the window of 11 x 11, rows and then columns, with zeros outside. */
static void blur(const double *image, double *out, long height, long width)
{
    double window[2 * RADIUS + 1], sum = 0.0, *rows = zeros(height * width, sizeof *rows);
    for (int k = -RADIUS; k <= RADIUS; k++)
        sum += window[k + RADIUS] = exp(-k * k / 4.5);
    for (int pass = 0; pass < 2; pass++) {
        const double *from = pass ? rows : image;
        double *to = pass ? out : rows;
        long step = pass ? width : 1, length = pass ? height : width;
        for (long p = 0; p < height * width; p++) {
            long at = pass ? p / width : p % width;
            to[p] = 0.0;
            for (long k = -RADIUS; k <= RADIUS; k++)
                if (at + k >= 0 && at + k < length)
                    to[p] += window[k + RADIUS] / sum * from[p + k * step];
        }
    }
    free(rows);
}

/* What the window makes of one channel: means, and the sums that the variances need. */
typedef struct {
    double *x, *y, *mean_x, *mean_y, *xx, *yy, *xy;
} Windows;

static double *blurred_product(const double *a, const double *b, long height, long width)
{
    double *product = zeros(height * width, sizeof *product), *out = zeros(height * width, sizeof *out);
    for (long p = 0; p < height * width; p++)
        product[p] = a[p] * (b ? b[p] : 1.0);
    blur(product, out, height, width);
    free(product);
    return out;
}

/* SSIM at every pixel, and its derivatives by the mean of x, of x x and of x y. */
static double ssim_at(const Windows *w, long p, double by[3])
{
    double mx = w->mean_x[p], my = w->mean_y[p];
    double a1 = 2.0 * mx * my + 1e-4, a2 = 2.0 * (w->xy[p] - mx * my) + 9e-4;
    double b1 = mx * mx + my * my + 1e-4, b2 = w->xx[p] - mx * mx + w->yy[p] - my * my + 9e-4;
    double map = a1 * a2 / (b1 * b2);
    by[0] = 2.0 * my * (a2 - a1) / (b1 * b2) - 2.0 * mx * map * (1.0 / b1 - 1.0 / b2);
    by[1] = -map / b2;
    by[2] = 2.0 * a1 / (b1 * b2);
    return map;
}

/* Sum of one channel over tissue; `d` becomes its gradient times `share`. */
static double channel_ssim(const real *x, const real *y, const uint8_t *mask, long height, long width, double share,
                           real *d)
{
    long pixels = height * width;
    double sum = 0.0, *back[3], *by[3];
    Windows w = {zeros(pixels, 8), zeros(pixels, 8), NULL, NULL, NULL, NULL, NULL};
    for (long p = 0; p < pixels; p++) {
        w.x[p] = mask[p] ? x[p] : 0.0;
        w.y[p] = mask[p] ? y[p] : 0.0;
    }
    w.mean_x = blurred_product(w.x, NULL, height, width);
    w.mean_y = blurred_product(w.y, NULL, height, width);
    w.xx = blurred_product(w.x, w.x, height, width);
    w.yy = blurred_product(w.y, w.y, height, width);
    w.xy = blurred_product(w.x, w.y, height, width);
    for (int k = 0; k < 3; k++) {
        back[k] = zeros(pixels, 8);
        by[k] = zeros(pixels, 8);
    }
    for (long p = 0; p < pixels; p++) {
        double slopes[3], map = ssim_at(&w, p, slopes);
        sum += mask[p] ? map : 0.0;
        for (int k = 0; k < 3; k++)
            by[k][p] = mask[p] ? share * slopes[k] : 0.0;
    }
    for (int k = 0; k < 3; k++)
        blur(by[k], back[k], height, width);
    for (long p = 0; p < pixels; p++)
        d[p] = mask[p] ? (real)(back[0][p] + 2.0 * w.x[p] * back[1][p] + w.y[p] * back[2][p]) : 0;
    double *all[] = {w.x, w.y, w.mean_x, w.mean_y, w.xx, w.yy, w.xy, back[0], back[1], back[2], by[0], by[1], by[2]};
    for (size_t k = 0; k < sizeof all / sizeof *all; k++)
        free(all[k]);
    return sum;
}

void masked_ssim(Request *request)
{
    const real *rendered = in_real(request, "rendered"), *observed = in_real(request, "observed");
    const uint8_t *mask = in_boolean(request, "mask");
    long height = in_size(request, "mask", 0), width = in_size(request, "mask", 1), pixels = height * width;
    double count = 3.0 * (double)count_of(mask, pixels), d_ssim = *in_real(request, "d_ssim"), sum = 0.0;
    real *d_rendered = out_real(request, "d_rendered", 3 * pixels);
    for (long c = 0; c < 3 && count > 0.0; c++)
        sum += channel_ssim(rendered + c * pixels, observed + c * pixels, mask, height, width, d_ssim / count,
                            d_rendered + c * pixels);
    *out_real(request, "ssim", 1) = (real)(count > 0.0 ? sum / count : 1.0);
}

static double largest_finite(const real *values, long count)
{
    double largest = 0.0;
    for (long p = 0; p < count; p++)
        if (isfinite(values[p]) && values[p] > largest)
            largest = values[p];
    return largest;
}

void normalised_depth(Request *request)
{
    const real *depth = in_real(request, "rendered_depth"), *prior = in_real(request, "prior_depth");
    const uint8_t *mask = in_boolean(request, "mask");
    long pixels = in_size(request, "mask", 0) * in_size(request, "mask", 1), valid = 0, ties = 0;
    double highest = largest_finite(depth, pixels), known = largest_finite(prior, pixels), loss = 0.0, through = 0.0;
    double d_loss = *in_real(request, "d_loss");
    real *d_depth = out_real(request, "d_rendered_depth", pixels);
    uint8_t *use = zeros(pixels, 1);
    for (long p = 0; p < pixels; p++) {
        use[p] = mask[p] && isfinite(prior[p]) && prior[p] > 0;
        valid += use[p];
        ties += depth[p] == (real)highest;
    }
    if (valid >= FEWEST_PRIORS && highest > 0.0) {
        double share = d_loss / (double)valid;
        for (long p = 0; p < pixels; p++) {
            double difference = use[p] ? depth[p] / highest - prior[p] / known : 0.0;
            loss += fabs(difference) / (double)valid;
            through += sign_of(difference) * (use[p] ? depth[p] : 0.0);
            d_depth[p] = (real)(sign_of(difference) * share / highest);
        }
        for (long p = 0; p < pixels; p++)
            d_depth[p] -= depth[p] == (real)highest ? (real)(share * through / (highest * highest) / (double)ties) : 0;
    }
    *out_real(request, "loss", 1) = (real)loss;
    free(use);
}

/* Squared steps between neighbours that both count, over their number; absolute ones where `counts` is NULL. */
static double steps(const real *plane, const uint8_t *counts, const uint8_t *mask, long height, long width,
                    double share, real *d)
{
    double sum = 0.0;
    for (long p = 0; p < height * width; p++)
        for (int down = 0; down < 2; down++) {
            long q = down ? p - width : p - 1;
            if ((down ? p < width : p % width == 0) || (counts && !(counts[p] && counts[q])))
                continue;
            double step = counts ? (double)plane[p] - plane[q]
                                 : (mask[p] ? 0.0 : (double)plane[p]) - (mask[q] ? 0.0 : (double)plane[q]);
            double slope = share * (counts ? 2.0 * step : sign_of(step));
            sum += counts ? step * step : fabs(step);
            d[p] += (real)(counts || !mask[p] ? slope : 0.0);
            d[q] -= (real)(counts || !mask[q] ? slope : 0.0);
        }
    return sum;
}

void smoothness(Request *request)
{
    const real *depth = in_real(request, "rendered_depth"), *colour = in_real(request, "rendered");
    const uint8_t *mask = in_boolean(request, "mask"), *edges = in_boolean(request, "edges");
    long height = in_size(request, "mask", 0), width = in_size(request, "mask", 1), pixels = height * width;
    double factor = setting(request, "total_variation_factor"), d_loss = *in_real(request, "d_loss"), loss;
    real *d_depth = out_real(request, "d_rendered_depth", pixels), *d_colour = out_real(request, "d_rendered", 3 * pixels);
    uint8_t *smooth = zeros(pixels, 1);
    for (long p = 0; p < pixels; p++)
        smooth[p] = mask[p] && !edges[p];
    double count = (double)count_of(smooth, pixels) + 1e-6, size = (double)pixels;
    loss = steps(depth, smooth, mask, height, width, d_loss / count, d_depth) / count;
    loss += factor * steps(depth, NULL, mask, height, width, factor * d_loss / size, d_depth) / size;
    for (long c = 0; c < 3; c++)
        loss += factor / (3.0 * size)
                * steps(colour + c * pixels, NULL, mask, height, width, factor * d_loss / (3.0 * size),
                        d_colour + c * pixels);
    *out_real(request, "loss", 1) = (real)loss;
    free(smooth);
}
