/* Compositing of screen Gaussians, equation (B5): a plain loop over pixels and Gaussians, no tiles. */
#include "port.h"

#include <stdlib.h>
#include <string.h>

enum { TILE = 16, TERMS = 10 };
enum { U, V, GA, GM, GR, LOGIT, RED, GREEN, BLUE, DEPTH }; /* gradient terms of a Gaussian */

typedef struct {
    real u, v, m, r, a_big, z, opacity, rgb[3]; /* a_big: the A of equation (B5) */
    real a, b, c, determinant;
    int left, right, top, bottom; /* pixels that the support reaches */
    long index;
} Splat;

typedef struct {
    real cutoff, stop, largest;
    bool tiles, drop_depth, pass_clamped, conic;
    int width, height;
} Rules;

typedef struct {
    const Splat *splat;
    real eta, dy, alpha, free_alpha, light; /* free_alpha: before the clamp; light: T in front of it */
} Hit;

static Rules rules_of(const Request *request)
{
    Rules rules;
    rules.cutoff = (real)setting(request, "raster.alpha_cutoff");
    rules.stop = (real)setting(request, "raster.transmittance_stop");
    rules.largest = (real)setting(request, "raster.alpha_max");
    rules.tiles = setting_is(request, "raster.support", "three_sigma_tiles");
    rules.drop_depth = setting_is(request, "raster.deviations.drop_depth_to_z", "true");
    rules.pass_clamped = setting_is(request, "raster.deviations.pass_clamped_alpha", "true");
    rules.conic = setting_is(request, "raster.deviations.conic_epsilon", "true");
    return rules;
}

/* First and last pixel + 1 of the tiles within `radius` of a centre coordinate. */
static void tiles_around(real centre, real radius, int size, int *first, int *stop)
{
    real p = centre - (real)0.5;
    int low = (int)trunc((p - radius) / TILE), high = (int)trunc((p + radius + TILE - 1) / TILE);
    *first = low < 0 ? 0 : low * TILE;
    *stop = high * TILE < size ? high * TILE : size;
}

static void reach(Splat *splat, const Rules *rules)
{
    splat->left = splat->top = 0;
    splat->right = rules->width;
    splat->bottom = rules->height;
    if (!rules->tiles)
        return; /* the ellipse is where alpha reaches the cutoff, which is asked at every pixel */
    real half = (splat->a + splat->c) / 2;
    real radius = ceil(3 * sqrt(half + sqrt(fmax((real)0.1, half * half - splat->determinant))));
    tiles_around(splat->u, radius, rules->width, &splat->left, &splat->right);
    tiles_around(splat->v, radius, rules->height, &splat->top, &splat->bottom);
}

static int nearer(const void *x, const void *y)
{
    const Splat *a = x, *b = y;
    return a->z != b->z ? (a->z > b->z) - (a->z < b->z) : (a->index > b->index) - (a->index < b->index);
}

/* The Gaussians front to back; equal depths keep the order of their index. */
static Splat *sorted(Request *request, const Rules *rules, long n)
{
    const real *mean = in_real(request, "mean2d"), *cover = in_real(request, "covariance2d");
    const real *depth = in_real(request, "depth"), *logit = in_real(request, "opacity_logit");
    const real *colour = in_real(request, "colour");
    Splat *splats = zeros(n, sizeof *splats);
    for (long i = 0; i < n; i++) {
        real a = cover[i], b = cover[n + i], c = cover[2 * n + i], determinant = a * c - b * b;
        Splat *s = &splats[i];
        *s = (Splat){.u = mean[i], .v = mean[n + i], .m = b / c, .r = 1 / c, .a_big = c / determinant, .z = depth[i],
                     .opacity = 1 / (1 + exp(-logit[i])), .a = a, .b = b, .c = c, .determinant = determinant, .index = i};
        for (int k = 0; k < 3; k++)
            s->rgb[k] = colour[k * n + i];
        reach(s, rules);
    }
    qsort(splats, (size_t)n, sizeof *splats, nearer);
    return splats;
}

/* The contributors of a pixel; returns how many, and the light that is left. */
static long gather(const Splat *splats, long n, const Rules *rules, int x, int y, Hit *hits, real *left)
{
    long found = 0;
    *left = 1;
    for (long k = 0; k < n; k++) {
        const Splat *s = &splats[k];
        if (x < s->left || x >= s->right || y < s->top || y >= s->bottom)
            continue;
        real dx = (real)x + (real)0.5 - s->u, dy = (real)y + (real)0.5 - s->v, eta = dx - s->m * dy;
        real free_alpha = s->opacity * exp(-(s->r * dy * dy + s->a_big * eta * eta) / 2);
        real alpha = fmin(free_alpha, rules->largest);
        if (alpha < rules->cutoff)
            continue;
        if (*left * (1 - alpha) < rules->stop)
            break;
        hits[found++] = (Hit){s, eta, dy, alpha, free_alpha, *left};
        *left *= 1 - alpha;
    }
    return found;
}

/* Adds what one contributor gets to the sums of its Gaussian. */
static void footprint_reverse(const Hit *hit, const Rules *rules, double d_alpha, double *sum)
{
    const Splat *s = hit->splat;
    if (hit->free_alpha > rules->largest && !rules->pass_clamped)
        return;
    double d_q = -0.5 * hit->free_alpha * d_alpha;
    sum[LOGIT] += hit->free_alpha * (1 - s->opacity) * d_alpha;
    sum[GA] += hit->eta * hit->eta * d_q;
    sum[GM] += -2.0 * s->a_big * hit->eta * hit->dy * d_q;
    sum[GR] += hit->dy * hit->dy * d_q;
    sum[U] += -2.0 * s->a_big * hit->eta * d_q;
    sum[V] += -2.0 * (s->r * hit->dy - s->a_big * s->m * hit->eta) * d_q;
}

/* Back to front, dividing by nothing; g: gradients of red, green, blue, depth, opacity at this pixel. */
static void pixel_reverse(const Hit *hits, long found, const Rules *rules, const real *background, const real g[5],
                          double *sums)
{
    double behind[5] = {background[0], background[1], background[2], 0.0, 0.0};
    for (long k = found - 1; k >= 0; k--) {
        const Hit *hit = &hits[k];
        const Splat *s = hit->splat;
        double own[5] = {s->rgb[0], s->rgb[1], s->rgb[2], s->z, 1.0}, d_alpha = 0.0, *sum = sums + TERMS * s->index;
        for (int c = 0; c < 5; c++) {
            d_alpha += hit->light * (own[c] - behind[c]) * g[c];
            behind[c] = hit->alpha * own[c] + (1.0 - hit->alpha) * behind[c];
        }
        for (int c = 0; c < 3; c++)
            sum[RED + c] += hit->alpha * hit->light * g[c];
        sum[DEPTH] += rules->drop_depth ? 0.0 : hit->alpha * hit->light * g[3];
        footprint_reverse(hit, rules, d_alpha, sum);
    }
}

/* The gradients of the Gaussians from their sums over pixels. */
static void write_gradients(Request *request, const Splat *splats, const double *sums, const Rules *rules, long n)
{
    real *d_mean = out_real(request, "d_mean2d", 2 * n), *d_cover = out_real(request, "d_covariance2d", 3 * n);
    real *d_logit = out_real(request, "d_opacity_logit", n), *d_colour = out_real(request, "d_colour", 3 * n);
    real *d_depth = out_real(request, "d_depth", n);
    for (long k = 0; k < n; k++) {
        const Splat *s = &splats[k];
        const double *sum = sums + TERMS * s->index;
        double big = s->a_big, m = s->m, r = s->r, square = (double)s->determinant * s->determinant;
        double factor = rules->conic ? square / (square + 1e-7) : 1.0;
        long i = s->index;
        d_mean[i] = (real)sum[U];
        d_mean[n + i] = (real)sum[V];
        d_cover[i] = (real)(factor * -big * big * sum[GA]);
        d_cover[n + i] = (real)(factor * (2.0 * big * big * m * sum[GA] + r * sum[GM]));
        d_cover[2 * n + i] = (real)(factor * (-big * big * m * m * sum[GA] - m * r * sum[GM] - r * r * sum[GR]));
        d_logit[i] = (real)sum[LOGIT];
        d_depth[i] = (real)sum[DEPTH];
        for (int c = 0; c < 3; c++)
            d_colour[c * n + i] = (real)sum[RED + c];
    }
}

void composite(Request *request)
{
    const real *background = in_real(request, "background"), *d_colour = in_real(request, "d_colour_image");
    const real *d_depth = in_real(request, "d_depth_image"), *d_opacity = in_real(request, "d_opacity_image");
    long n = in_size(request, "depth", 0);
    Rules rules = rules_of(request);
    rules.width = (int)setting(request, "width");
    rules.height = (int)setting(request, "height");
    long pixels = (long)rules.width * rules.height;
    real *colour = out_real(request, "colour_image", 3 * pixels), *depth = out_real(request, "depth_image", pixels);
    real *opacity = out_real(request, "opacity_image", pixels), *d_background = out_real(request, "d_background", 3);
    Splat *splats = sorted(request, &rules, n);
    Hit *hits = zeros(n, sizeof *hits);
    double *sums = zeros(TERMS * n, sizeof *sums);
    for (long p = 0; p < pixels; p++) {
        real left, g[5] = {d_colour[p], d_colour[pixels + p], d_colour[2 * pixels + p], d_depth[p], d_opacity[p]};
        int column = (int)(p % rules.width), row = (int)(p / rules.width);
        long found = gather(splats, n, &rules, column, row, hits, &left);
        for (long k = 0; k < found; k++) {
            real share = hits[k].alpha * hits[k].light;
            for (int c = 0; c < 3; c++)
                colour[c * pixels + p] += share * hits[k].splat->rgb[c];
            depth[p] += share * hits[k].splat->z;
            opacity[p] += share;
        }
        for (int c = 0; c < 3; c++) {
            colour[c * pixels + p] += left * background[c];
            d_background[c] += left * g[c];
        }
        pixel_reverse(hits, found, &rules, background, g, sums);
    }
    write_gradients(request, splats, sums, &rules, n);
    free(splats);
    free(hits);
    free(sums);
}

/* Whether the box of the ellipse of alpha >= cutoff holds a pixel centre. */
static bool in_a_box(const Splat *splat, const Rules *rules)
{
    real reach = 2 * log(splat->opacity / rules->cutoff), centre[2] = {splat->u, splat->v};
    real variance[2] = {splat->a, splat->c};
    int size[2] = {rules->width, rules->height};
    for (int k = 0; k < 2; k++) {
        real half = sqrt(fmax(reach, (real)0) * variance[k]);
        real first = ceil(centre[k] - half - (real)0.5), last = floor(centre[k] + half - (real)0.5);
        if (!(reach >= 0) || fmin(last, (real)(size[k] - 1)) < fmax(first, (real)0))
            return false;
    }
    return true;
}

/* The visible Gaussians of `render`, front to back; returns how many. */
static long screened(Request *request, const Rules *rules, long n, Splat *splats, uint8_t *visible)
{
    real *mean = scratch(request, 2 * n), *cover = scratch(request, 3 * n), *determinant = scratch(request, n);
    real *depth = scratch(request, n), *colour = scratch(request, 3 * n), centre[3] = {0, 0, 0};
    const real *logit = in_real(request, "opacity_logit"), *w = in_real(request, "rotation_matrix");
    const real *d = in_real(request, "translation");
    long found = 0;
    for (int k = 0; k < 9; k++)
        centre[k % 3] -= w[k] * d[k / 3];
    projected(request, n, visible, mean, cover, determinant, depth);
    coloured(request, centre, n, colour);
    for (long i = 0; i < n; i++) {
        real a = cover[i], b = cover[n + i], c = cover[2 * n + i];
        if (!visible[i])
            continue;
        Splat *s = &splats[found++];
        *s = (Splat){.u = mean[i], .v = mean[n + i], .m = b / c, .r = 1 / c, .a_big = c / determinant[i], .z = depth[i],
                     .opacity = 1 / (1 + exp(-logit[i])), .a = a, .b = b, .c = c, .determinant = determinant[i],
                     .index = i, .rgb = {colour[i], colour[n + i], colour[2 * n + i]}};
        reach(s, rules);
        visible[i] = in_a_box(s, rules);
    }
    qsort(splats, (size_t)found, sizeof *splats, nearer);
    return found;
}

/* The images of a camera; this port has no reverse pass of `render`. */
void render(Request *request)
{
    const real *background = in_real(request, "background");
    long n = in_size(request, "opacity_logit", 0);
    Rules rules = rules_of(request);
    rules.width = (int)setting(request, "camera.width");
    rules.height = (int)setting(request, "camera.height");
    long pixels = (long)rules.width * rules.height;
    real *colour = out_real(request, "colour_image", 3 * pixels), *depth = out_real(request, "depth_image", pixels);
    real *opacity = out_real(request, "opacity_image", pixels);
    Splat *splats = zeros(n, sizeof *splats);
    Hit *hits = zeros(n, sizeof *hits);
    long shown = screened(request, &rules, n, splats, out_boolean(request, "visible", n));
    for (long p = 0; p < pixels; p++) {
        real left;
        long found = gather(splats, shown, &rules, (int)(p % rules.width), (int)(p / rules.width), hits, &left);
        for (long k = 0; k < found; k++) {
            real share = hits[k].alpha * hits[k].light;
            for (int c = 0; c < 3; c++)
                colour[c * pixels + p] += share * hits[k].splat->rgb[c];
            depth[p] += share * hits[k].splat->z;
            opacity[p] = opacity[p] + share;
        }
        for (int c = 0; c < 3; c++)
            colour[c * pixels + p] += background[c] * left;
    }
    free(splats);
    free(hits);
}
