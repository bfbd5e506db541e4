/* Covariance, equation (B2), and projection, equation (B3). Matrices of one Gaussian are local arrays. */
#include "port.h"

static const real LARGEST_LOG_SCALE = 40;

/* Unit quaternion w, x, y, z and 1 / norm; false for a zero quaternion, which is the identity. */
static bool unit(const real *raw, long count, real q[4], real *inverse_norm)
{
    real largest = 0, square = 0;
    for (int k = 0; k < 4; k++)
        largest = fmax(largest, fabs(raw[k * count]));
    for (int k = 0; k < 4; k++) {
        q[k] = largest > 0 ? raw[k * count] / largest : (real)(k == 0);
        square += q[k] * q[k];
    }
    for (int k = 0; k < 4; k++)
        q[k] /= sqrt(square);
    *inverse_norm = 1 / (fmax(largest, (real)1e-20) * sqrt(square));
    return largest > 0;
}

static void rotation_of(const real q[4], real r[3][3])
{
    real w = q[0], x = q[1], y = q[2], z = q[3];
    real rows[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                       {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                       {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
    for (int k = 0; k < 9; k++)
        r[k / 3][k % 3] = rows[k / 3][k % 3];
}

static void rotation_reverse(const real q[4], real g[3][3], real d[4])
{
    real w = q[0], x = q[1], y = q[2], z = q[3];
    d[0] = 2 * (x * (g[2][1] - g[1][2]) + y * (g[0][2] - g[2][0]) + z * (g[1][0] - g[0][1]));
    d[1] = 2 * (-2 * x * (g[1][1] + g[2][2]) + y * (g[0][1] + g[1][0]) + z * (g[0][2] + g[2][0])
                + w * (g[2][1] - g[1][2]));
    d[2] = 2 * (x * (g[0][1] + g[1][0]) - 2 * y * (g[0][0] + g[2][2]) + z * (g[1][2] + g[2][1])
                + w * (g[0][2] - g[2][0]));
    d[3] = 2 * (x * (g[0][2] + g[2][0]) + y * (g[1][2] + g[2][1]) - 2 * z * (g[0][0] + g[1][1])
                + w * (g[1][0] - g[0][1]));
}

void covariance(Request *request)
{
    const real *quaternion = in_real(request, "quaternion"), *log_scale = in_real(request, "log_scale");
    const real *d_rotation = in_real(request, "d_rotation"), *d_scale = in_real(request, "d_scale");
    long count = in_size(request, "quaternion", 1);
    real *rotation = out_real(request, "rotation", 9 * count), *scale = out_real(request, "scale", 3 * count);
    real *d_quaternion = out_real(request, "d_quaternion", 4 * count);
    real *d_log_scale = out_real(request, "d_log_scale", 3 * count);
    for (long i = 0; i < count; i++) {
        real q[4], r[3][3], g[3][3], d_q[4], inverse_norm, along = 0;
        bool turns = unit(quaternion + i, count, q, &inverse_norm);
        rotation_of(q, r);
        for (int k = 0; k < 9; k++) {
            rotation[k * count + i] = r[k / 3][k % 3];
            g[k / 3][k % 3] = d_rotation[k * count + i];
        }
        rotation_reverse(q, g, d_q);
        for (int k = 0; k < 4; k++)
            along += q[k] * d_q[k];
        for (int k = 0; k < 4; k++)
            d_quaternion[k * count + i] = turns ? (d_q[k] - along * q[k]) * inverse_norm : 0;
        for (int k = 0; k < 3; k++) {
            real s = log_scale[k * count + i];
            scale[k * count + i] = exp(fmin(fmax(s, -LARGEST_LOG_SCALE), LARGEST_LOG_SCALE));
            bool clipped = fabs(s) > LARGEST_LOG_SCALE;
            d_log_scale[k * count + i] = clipped ? 0 : scale[k * count + i] * d_scale[k * count + i];
        }
    }
}

/* What equation (B3) makes of one Gaussian. `clamped` is 0 within the limit of the Jacobian, else 1. */
typedef struct {
    real point[3], at[2]; /* in camera axes; x', y' */
    bool clamped[2];
    real turned[3][3], t[2][3], jacobian[2][3]; /* W R; T; J */
} View;

typedef struct {
    real w[3][3], d[3], focal[2], limit[2], low_pass, near;
    bool twice; /* the deviation `double_clamp_term` */
} Lens;

static Lens lens_of(Request *request)
{
    Lens lens;
    real clamp = (real)setting(request, "raster.jacobian_clamp");
    const real *w = in_real(request, "rotation_matrix"), *d = in_real(request, "translation");
    for (int k = 0; k < 9; k++)
        lens.w[k / 3][k % 3] = w[k];
    for (int k = 0; k < 3; k++)
        lens.d[k] = d[k];
    lens.focal[0] = (real)setting(request, "camera.fx");
    lens.focal[1] = (real)setting(request, "camera.fy");
    lens.limit[0] = clamp > 0 ? clamp * (real)setting(request, "camera.width") / (2 * lens.focal[0]) : (real)INFINITY;
    lens.limit[1] = clamp > 0 ? clamp * (real)setting(request, "camera.height") / (2 * lens.focal[1]) : (real)INFINITY;
    lens.low_pass = (real)setting(request, "raster.low_pass");
    lens.near = (real)setting(request, "raster.near");
    lens.twice = setting_is(request, "raster.deviations.double_clamp_term", "true");
    return lens;
}

static bool seen(const Lens *lens, const real *position, long count, View *view)
{
    for (int r = 0; r < 3; r++) {
        view->point[r] = lens->d[r];
        for (int k = 0; k < 3; k++)
            view->point[r] += lens->w[r][k] * position[k * count];
    }
    return view->point[2] > lens->near;
}

static void linearise(const Lens *lens, const real *rotation, long count, View *view)
{
    real z = view->point[2];
    for (int r = 0; r < 2; r++) {
        real slope = view->point[r] / z;
        view->clamped[r] = fabs(slope) > lens->limit[r];
        view->at[r] = z * fmin(fmax(slope, -lens->limit[r]), lens->limit[r]);
        view->jacobian[r][0] = view->jacobian[r][1] = 0;
        view->jacobian[r][r] = lens->focal[r] / z;
        view->jacobian[r][2] = -lens->focal[r] * view->at[r] / (z * z);
    }
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            view->turned[r][c] = 0;
            for (int k = 0; k < 3; k++)
                view->turned[r][c] += lens->w[r][k] * rotation[(3 * k + c) * count];
        }
    for (int r = 0; r < 2; r++)
        for (int c = 0; c < 3; c++)
            view->t[r][c] = view->jacobian[r][r] * view->turned[r][c] + view->jacobian[r][2] * view->turned[2][c];
}

/* Gradients of T and of the three semi-axes from those of a, b, c. */
static void covariance2d_reverse(const View *view, const real s[3], const real d_cover[3], real d_t[2][3], real d_s[3])
{
    real g[2][2] = {{d_cover[0], d_cover[1] / 2}, {d_cover[1] / 2, d_cover[2]}};
    for (int k = 0; k < 3; k++) {
        d_s[k] = 0;
        for (int r = 0; r < 2; r++) {
            real d_m = 2 * (g[r][0] * view->t[0][k] + g[r][1] * view->t[1][k]) * s[k];
            d_s[k] += view->t[r][k] * d_m;
            d_t[r][k] = d_m * s[k];
        }
    }
}

/* Gradient of the centre in camera axes. */
static void centre_reverse(const Lens *lens, const View *view, const real d_mean[2], real d_depth, real d_j[2][3],
                           real d_point[3])
{
    real z = view->point[2];
    d_point[2] = d_depth;
    for (int r = 0; r < 2; r++) {
        real f = lens->focal[r], d_at = -f / (z * z) * d_j[r][2];
        d_point[r] = f / z * d_mean[r] + (view->clamped[r] ? 0 : d_at);
        d_point[2] += -f * view->point[r] * d_mean[r] / (z * z) - f / (z * z) * d_j[r][r]
                      + 2 * f * view->at[r] / (z * z * z) * d_j[r][2];
        if (view->clamped[r] && !lens->twice)
            d_point[2] += view->at[r] / z * d_at;
    }
}

void projection(Request *request)
{
    const real *position = in_real(request, "position"), *rotation = in_real(request, "rotation");
    const real *scale = in_real(request, "scale"), *d_mean2d = in_real(request, "d_mean2d");
    const real *d_covariance2d = in_real(request, "d_covariance2d"), *d_depth = in_real(request, "d_depth");
    long n = in_size(request, "position", 1);
    Lens lens = lens_of(request);
    real principal[2] = {(real)setting(request, "camera.cx"), (real)setting(request, "camera.cy")};
    uint8_t *visible = out_boolean(request, "visible", n);
    real *mean2d = out_real(request, "mean2d", 2 * n), *covariance2d = out_real(request, "covariance2d", 3 * n);
    real *depth = out_real(request, "depth", n), *d_position = out_real(request, "d_position", 3 * n);
    real *d_rotation = out_real(request, "d_rotation", 9 * n), *d_scale = out_real(request, "d_scale", 3 * n);
    real *d_pose = out_real(request, "d_rotation_matrix", 9), *d_translation = out_real(request, "d_translation", 3);
    for (long i = 0; i < n; i++) {
        View view;
        visible[i] = seen(&lens, position + i, n, &view);
        if (!visible[i])
            continue;
        linearise(&lens, rotation + i, n, &view);
        real s[3] = {scale[i], scale[n + i], scale[2 * n + i]}, d_t[2][3], d_s[3], d_j[2][3], d_point[3];
        real d_mean[2] = {d_mean2d[i], d_mean2d[n + i]};
        real d_cover[3] = {d_covariance2d[i], d_covariance2d[n + i], d_covariance2d[2 * n + i]};
        depth[i] = view.point[2];
        for (int r = 0; r < 2; r++)
            mean2d[r * n + i] = lens.focal[r] * view.point[r] / view.point[2] + principal[r];
        for (int e = 0; e < 3; e++) { /* a, b, c are the entries (0, 0), (0, 1), (1, 1) */
            covariance2d[e * n + i] = e == 1 ? 0 : lens.low_pass;
            for (int k = 0; k < 3; k++)
                covariance2d[e * n + i] += s[k] * s[k] * view.t[e / 2][k] * view.t[(e + 1) / 2][k];
        }
        covariance2d_reverse(&view, s, d_cover, d_t, d_s);
        for (int r = 0; r < 2; r++)
            for (int c = 0; c < 3; c++) {
                d_j[r][c] = 0;
                for (int k = 0; k < 3; k++)
                    d_j[r][c] += d_t[r][k] * view.turned[c][k];
            }
        centre_reverse(&lens, &view, d_mean, d_depth[i], d_j, d_point);
        for (int r = 0; r < 3; r++) {
            d_scale[r * n + i] = d_s[r];
            d_translation[r] += d_point[r];
            for (int c = 0; c < 3; c++) {
                d_position[c * n + i] += lens.w[r][c] * d_point[r];
                d_pose[3 * r + c] += d_point[r] * position[c * n + i];
                for (int k = 0; k < 3; k++) { /* d_turned[r][k] = sum over rows of J' d_T */
                    real d_turned = view.jacobian[0][r] * d_t[0][k] + view.jacobian[1][r] * d_t[1][k];
                    d_pose[3 * r + c] += d_turned * rotation[(3 * c + k) * n + i];
                    d_rotation[(3 * c + k) * n + i] += lens.w[r][c] * d_turned;
                }
            }
        }
    }
}

/* e^2 + e |M|^2 + the sum over k < m of (S_k S_m (T_0k T_1m - T_0m T_1k))^2: no difference of nearly equal numbers. */
static real determinant_of(const View *view, const real s[3], real e)
{
    real sum = e * e;
    for (int k = 0; k < 3; k++) {
        real u = s[k] * view->t[0][k], v = s[k] * view->t[1][k];
        sum += e * (u * u + v * v);
        for (int m = k + 1; m < 3; m++) {
            real minor = s[k] * s[m] * (view->t[0][k] * view->t[1][m] - view->t[0][m] * view->t[1][k]);
            sum += minor * minor;
        }
    }
    return sum;
}

/* Screen Gaussians of `render`, from its raw parameters, without a reverse pass. */
void projected(Request *request, long n, uint8_t *visible, real *mean, real *cover, real *determinant, real *depth)
{
    const real *quaternion = in_real(request, "quaternion"), *log_scale = in_real(request, "log_scale");
    const real *position = in_real(request, "position");
    real principal[2] = {(real)setting(request, "camera.cx"), (real)setting(request, "camera.cy")};
    Lens lens = lens_of(request);
    for (long i = 0; i < n; i++) {
        View view;
        real q[4], r[3][3], s[3], inverse_norm;
        visible[i] = seen(&lens, position + i, n, &view);
        if (!visible[i])
            continue;
        unit(quaternion + i, n, q, &inverse_norm);
        rotation_of(q, r);
        for (int k = 0; k < 3; k++)
            s[k] = exp(fmin(fmax(log_scale[k * n + i], -LARGEST_LOG_SCALE), LARGEST_LOG_SCALE));
        linearise(&lens, &r[0][0], 1, &view);
        depth[i] = view.point[2];
        determinant[i] = determinant_of(&view, s, lens.low_pass);
        for (int k = 0; k < 2; k++)
            mean[k * n + i] = lens.focal[k] * view.point[k] / view.point[2] + principal[k];
        for (int e = 0; e < 3; e++) {
            cover[e * n + i] = e != 1 ? lens.low_pass : 0;
            for (int k = 0; k < 3; k++)
                cover[e * n + i] += s[k] * s[k] * view.t[e / 2][k] * view.t[(e + 1) / 2][k];
        }
    }
}
