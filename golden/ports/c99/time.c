/* Functions of time: equations (1), (1b), (2), (3), (4) and (B1). */
#include "port.h"

#include <string.h>

static const double DEAD = 1e-6, WIDTH_FLOOR = 1e-4;

/* sin and cos of 2 pi p, exact at quarter turns: what is left of the phase after the nearest quarter is small. */
static void turn(double p, double *sine, double *cosine)
{
    double r = p - round(p);
    int quarter = (int)round(4.0 * r);
    double rest = 2.0 * PI * (r - quarter / 4.0), s = sin(rest), c = cos(rest);
    switch ((quarter + 4) % 4) {
    case 0: *sine = s, *cosine = c; break;
    case 1: *sine = c, *cosine = -s; break;
    case 2: *sine = -s, *cosine = -c; break;
    default: *sine = -c, *cosine = s;
    }
}

void frequencies(Request *request)
{
    long count = (long)setting(request, "count");
    double low = setting(request, "low"), high = setting(request, "high");
    real *omega = out_real(request, "omega", count);
    for (long f = 0; f < count; f++)
        omega[f] = (real)(f == 0 ? low : f == count - 1 ? high : low * pow(high / low, (double)f / (double)(count - 1)));
}

void dictionary(Request *request)
{
    const real *omega = in_real(request, "omega"), *d_phi = in_real(request, "d_phi");
    long count = in_size(request, "omega", 0);
    double t = *in_real(request, "t"), d_t = 0.0;
    real *phi = out_real(request, "phi", 2 * count), *d_omega = out_real(request, "d_omega", count);
    for (long f = 0; f < count; f++) {
        double s, c;
        turn((double)omega[f] * t, &s, &c);
        double slope = 2.0 * PI * (d_phi[f] * c - d_phi[count + f] * s);
        phi[f] = (real)s;
        phi[count + f] = (real)c;
        d_omega[f] = (real)(t * slope);
        d_t += omega[f] * slope;
    }
    *out_real(request, "d_t", 1) = (real)d_t;
}

/* Atom k of 2F at time t. */
static double atom(const real *omega, long count, long k, double t)
{
    double s, c;
    turn((double)omega[k % count] * t, &s, &c);
    return k < count ? s : c;
}

static bool seen_before(const real *times, const int64_t *train, long k)
{
    for (long j = 0; j < k; j++)
        if (times[train[j]] == times[train[k]])
            return true;
    return false;
}

void atoms(Request *request)
{
    const real *times = in_real(request, "times"), *omega = in_real(request, "omega");
    const real *phi = in_real(request, "phi"), *d_phi_bar = in_real(request, "d_phi_bar");
    const int64_t *train = in_integer(request, "train_index");
    long stamps = in_size(request, "train_index", 0), count = in_size(request, "omega", 0);
    real *mean = out_real(request, "mean", 2 * count), *rms = out_real(request, "rms", 2 * count);
    real *phi_bar = out_real(request, "phi_bar", 2 * count), *d_phi = out_real(request, "d_phi", 2 * count);
    uint8_t *dead = out_boolean(request, "dead", 2 * count);
    for (long k = 0; k < 2 * count; k++) {
        double sum = 0.0, square = 0.0, distinct = 0.0;
        for (long j = 0; j < stamps; j++)
            if (!seen_before(times, train, j))
                sum += atom(omega, count, k, times[train[j]]), distinct += 1.0;
        for (long j = 0; j < stamps; j++)
            if (!seen_before(times, train, j))
                square += pow(atom(omega, count, k, times[train[j]]) - sum / distinct, 2.0);
        double spread = sqrt(square / distinct);
        dead[k] = spread < DEAD;
        mean[k] = (real)(sum / distinct);
        if (dead[k])
            continue;
        rms[k] = (real)spread;
        phi_bar[k] = (real)((phi[k] - sum / distinct) / spread);
        d_phi[k] = (real)(d_phi_bar[k] / spread);
    }
}

/* out[d, i] = sum over k of coefficients[d, k, i] atoms[k]; also its two derivatives. */
static void weighted(const real *coefficients, const real *atoms_now, long terms, long count, real *out)
{
    for (long d = 0; d < 3; d++)
        for (long i = 0; i < count; i++) {
            double sum = 0.0;
            for (long k = 0; k < terms; k++)
                sum += coefficients[(d * terms + k) * count + i] * atoms_now[k];
            out[d * count + i] = (real)sum;
        }
}

static void weighted_reverse(const real *d_out, const real *coefficients, const real *atoms_now, long terms, long count,
                             real *d_coefficients, real *d_atoms)
{
    for (long k = 0; k < terms; k++) {
        double sum = 0.0;
        for (long d = 0; d < 3; d++)
            for (long i = 0; i < count; i++) {
                d_coefficients[(d * terms + k) * count + i] = d_out[d * count + i] * atoms_now[k];
                sum += d_out[d * count + i] * coefficients[(d * terms + k) * count + i];
            }
        d_atoms[k] = (real)sum;
    }
}

void appearance(Request *request)
{
    const real *coefficients = in_real(request, "appearance_coefficients"), *phi_bar = in_real(request, "phi_bar");
    const real *d_residual = in_real(request, "d_residual");
    long terms = in_size(request, "phi_bar", 0), count = in_size(request, "d_residual", 1);
    real scale = (real)(setting(request, "beta") / Y00);
    real *x = scratch(request, 3 * count), *d_x = scratch(request, 3 * count);
    real *residual = out_real(request, "residual", 3 * count);
    weighted(coefficients, phi_bar, terms, count, x);
    for (long k = 0; k < 3 * count; k++) {
        real e = exp(-2 * fabs(x[k]));
        residual[k] = scale * tanh(x[k]);
        d_x[k] = scale * 4 * e / ((1 + e) * (1 + e)) * d_residual[k];
    }
    weighted_reverse(d_x, coefficients, phi_bar, terms, count, out_real(request, "d_appearance_coefficients", 3 * terms * count),
                     out_real(request, "d_phi_bar", terms));
}

void motion(Request *request)
{
    const real *coefficients = in_real(request, "motion_coefficients"), *phi = in_real(request, "phi");
    long terms = in_size(request, "phi", 0), count = in_size(request, "d_translation", 1);
    weighted(coefficients, phi, terms, count, out_real(request, "translation", 3 * count));
    weighted_reverse(in_real(request, "d_translation"), coefficients, phi, terms, count,
                     out_real(request, "d_motion_coefficients", 3 * terms * count), out_real(request, "d_phi", terms));
}

/* Unnormalised weight of one frequency, in the form that is finite for every correlation length. */
static double unnormalised(double length, double angular, double largest)
{
    if (length * largest >= sqrt(5.0)) {
        double s = 5.0 / (length * largest) / (length * largest), ratio = angular / largest;
        return pow((s + ratio * ratio) / (1.0 + s), 3.0);
    }
    return pow((5.0 + pow(length * angular, 2.0)) / (5.0 + pow(length * largest, 2.0)), 3.0);
}

void matern(Request *request)
{
    const real *omega = in_real(request, "omega"), *coefficients = in_real(request, "motion_coefficients");
    long count = in_size(request, "omega", 0), gaussians = in_size(request, "motion_coefficients", 2);
    double length = setting(request, "correlation_length"), d_penalty = *in_real(request, "d_penalty");
    double largest = 0.0, sum = 0.0, penalty = 0.0, norm = 6.0 * (double)gaussians * (double)count;
    real *rho = out_real(request, "rho", count);
    real *d_coefficients = out_real(request, "d_motion_coefficients", 6 * count * gaussians);
    for (long f = 0; f < count; f++)
        largest = fmax(largest, 2.0 * PI * omega[f]);
    for (long f = 0; f < count; f++)
        sum += unnormalised(length, 2.0 * PI * omega[f], largest);
    for (long f = 0; f < count; f++) {
        double weight = unnormalised(length, 2.0 * PI * omega[f], largest) * (double)count / sum;
        rho[f] = (real)weight;
        for (long d = 0; d < 3; d++)
            for (long k = f; k < 2 * count; k += count) /* the sine and the cosine */
                for (long i = 0; i < gaussians; i++) {
                    long at = (d * 2 * count + k) * gaussians + i;
                    penalty += weight * (double)coefficients[at] * coefficients[at] / norm;
                    d_coefficients[at] = (real)(2.0 * weight / norm * coefficients[at] * d_penalty);
                }
    }
    *out_real(request, "penalty", 1) = (real)penalty;
}

#define SMALLEST_BASIS 0x1p-60

void deformation(Request *request)
{
    const real *weight = in_real(request, "fdm_weight"), *centre = in_real(request, "fdm_centre");
    const real *width = in_real(request, "fdm_width"), *d_offsets = in_real(request, "d_offsets");
    long bases = in_size(request, "fdm_weight", 1), count = in_size(request, "fdm_weight", 2), all = 10 * bases * count;
    bool quartic = setting_is(request, "basis", "quartic");
    real t = *in_real(request, "t"), floor_of_square = (real)WIDTH_FLOOR;
    real *offsets = out_real(request, "offsets", 10 * count), *d_weight = out_real(request, "d_fdm_weight", all);
    real *d_centre = out_real(request, "d_fdm_centre", all), *d_width = out_real(request, "d_fdm_width", all);
    double d_t = 0.0;
    for (long at = 0; at < all; at++) {
        long channel = at / (bases * count) * count + at % count;
        real step = t - centre[at], square = width[at] * width[at] + floor_of_square, u = step * step / square;
        real e = quartic ? exp(-u * u) : exp(-u / 2);
        e = e < (real)SMALLEST_BASIS ? 0 : e; /* exactly 0, in the value and in all gradients */
        real up = weight[at] * e * d_offsets[channel] / square;
        offsets[channel] += weight[at] * e;
        d_weight[at] = e * d_offsets[channel];
        d_centre[at] = quartic ? 4 * up * u * step : up * step;
        d_width[at] = quartic ? 4 * up * u * u * width[at] : up * u * width[at];
        d_t -= d_centre[at];
    }
    *out_real(request, "d_t", 1) = (real)d_t;
}
