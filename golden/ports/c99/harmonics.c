/* Colour from harmonics of degree 0 to 3, equation (B4). */
#include "port.h"

static const real C1 = (real)0.4886025119029199, C2A = (real)1.0925484305920792, C2B = (real)0.31539156525252005,
                  C2C = (real)0.5462742152960396, C3A = (real)0.5900435899266435, C3B = (real)2.890611442640554,
                  C3C = (real)0.4570457994644658, C3D = (real)0.3731763325901154, C3E = (real)1.445305721320277;

static void set(real row[4], real value, real by_x, real by_y, real by_z, real factor)
{
    row[0] = factor * value;
    row[1] = factor * by_x;
    row[2] = factor * by_y;
    row[3] = factor * by_z;
}

/* Y_k and its derivatives by x, y, z, for k from 0 to 15. */
static void basis(real x, real y, real z, real row[16][4])
{
    real xx = x * x, yy = y * y, zz = z * z;
    set(row[0], 1, 0, 0, 0, (real)Y00);
    set(row[1], y, 0, 1, 0, -C1);
    set(row[2], z, 0, 0, 1, C1);
    set(row[3], x, 1, 0, 0, -C1);
    set(row[4], x * y, y, x, 0, C2A);
    set(row[5], y * z, 0, z, y, -C2A);
    set(row[6], 2 * zz - xx - yy, -2 * x, -2 * y, 4 * z, C2B);
    set(row[7], x * z, z, 0, x, -C2A);
    set(row[8], xx - yy, 2 * x, -2 * y, 0, C2C);
    set(row[9], y * (3 * xx - yy), 6 * x * y, 3 * xx - 3 * yy, 0, -C3A);
    set(row[10], x * y * z, y * z, x * z, x * y, C3B);
    set(row[11], y * (4 * zz - xx - yy), -2 * x * y, 4 * zz - xx - 3 * yy, 8 * y * z, -C3C);
    set(row[12], z * (2 * zz - 3 * xx - 3 * yy), -6 * x * z, -6 * y * z, 6 * zz - 3 * xx - 3 * yy, C3D);
    set(row[13], x * (4 * zz - xx - yy), 4 * zz - 3 * xx - yy, -2 * x * y, 8 * x * z, -C3C);
    set(row[14], z * (xx - yy), 2 * x * z, -2 * y * z, xx - yy, C3E);
    set(row[15], x * (xx - 3 * yy), 3 * xx - 3 * yy, -6 * x * y, 0, -C3A);
}

void harmonics(Request *request)
{
    const real *coefficients = in_real(request, "harmonics"), *residual = in_real(request, "residual");
    const real *position = in_real(request, "position"), *centre = in_real(request, "centre");
    const real *d_colour = in_real(request, "d_colour");
    long n = in_size(request, "position", 1), all = in_size(request, "harmonics", 0);
    int degree = (int)setting(request, "degree");
    real *colour = out_real(request, "colour", 3 * n), *d_coefficients = out_real(request, "d_harmonics", 3 * all * n);
    real *d_residual = out_real(request, "d_residual", 3 * n), *d_position = out_real(request, "d_position", 3 * n);
    real *d_centre = out_real(request, "d_centre", 3);
    for (long i = 0; i < n; i++) {
        real v[3], row[16][4], g[3] = {0, 0, 0}, along = 0;
        for (int k = 0; k < 3; k++)
            v[k] = position[k * n + i] - centre[k];
        real norm = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
        int used = norm > 0 ? (degree + 1) * (degree + 1) : 1;
        for (int k = 0; k < 3; k++)
            v[k] = norm > 0 ? v[k] / norm : 0;
        basis(v[0], v[1], v[2], row);
        for (long c = 0; c < 3; c++) {
            real value = (real)0.5 + row[0][0] * residual[c * n + i];
            for (int k = 0; k < used; k++)
                value += row[k][0] * coefficients[(3 * k + c) * n + i];
            real d_value = value >= 0 ? d_colour[c * n + i] : 0;
            colour[c * n + i] = fmax(value, (real)0);
            d_residual[c * n + i] = row[0][0] * d_value;
            for (int k = 0; k < used; k++) {
                d_coefficients[(3 * k + c) * n + i] = row[k][0] * d_value;
                for (int axis = 0; axis < 3; axis++)
                    g[axis] += row[k][1 + axis] * d_value * coefficients[(3 * k + c) * n + i];
            }
        }
        for (int k = 0; k < 3; k++)
            along += v[k] * g[k];
        for (int k = 0; k < 3 && norm > 0; k++) {
            d_position[k * n + i] = (g[k] - along * v[k]) / norm;
            d_centre[k] -= d_position[k * n + i];
        }
    }
}

/* Colours of `render`, without a reverse pass. */
void coloured(Request *request, const real centre[3], long n, real *colour)
{
    const real *coefficients = in_real(request, "harmonics"), *residual = in_real(request, "residual");
    const real *position = in_real(request, "position");
    int degree = (int)setting(request, "degree");
    for (long i = 0; i < n; i++) {
        real v[3], row[16][4], square = 0;
        for (int k = 0; k < 3; k++) {
            v[k] = position[i + k * n] - centre[k];
            square += v[k] * v[k];
        }
        real inverse = square > 0 ? 1 / sqrt(square) : 0;
        int used = square > 0 ? (degree + 1) * (degree + 1) : 1;
        basis(v[0] * inverse, v[1] * inverse, v[2] * inverse, row);
        for (long c = 0; c < 3; c++) {
            real value = row[0][0] * residual[i + c * n] + (real)0.5;
            for (int k = 0; k < used; k++)
                value += row[k][0] * coefficients[(3 * k + c) * n + i];
            colour[c * n + i] = value > 0 ? value : 0;
        }
    }
}
