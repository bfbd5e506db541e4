/* A small port of endotsr in C99: what its files share.
 *
 * One source, one precision a program: compile with -DREAL=float or -DREAL=double. Sums over pixels, Gaussians or
 * stamps are taken in double in both. <tgmath.h> picks sqrt or sqrtf by the type of the argument.
 */
#ifndef PORT_H
#define PORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <tgmath.h>

#ifndef REAL
#define REAL double
#endif
typedef REAL real;

#define PI 3.14159265358979323846
#define Y00 0.28209479177387814

enum { MOST_AXES = 4, MOST_ARRAYS = 32, LONGEST_NAME = 48, LONGEST_PATH = 1024 };

/* An array in row-major order. kind: 'f' = real, 'i' = int64_t, 'u' = uint64_t, 'b' = one byte a value, 0 or 1. */
typedef struct {
    char name[LONGEST_NAME];
    char kind;
    int rank;
    long shape[MOST_AXES];
    long count;
    void *data;
} Array;

/* One case: its request.json and the arrays read and made so far. */
typedef struct {
    char folder[LONGEST_PATH], target[LONGEST_PATH];
    char *text;
    Array inputs[MOST_ARRAYS], outputs[MOST_ARRAYS];
    int input_count, output_count;
    void *scratch[MOST_ARRAYS];
    int scratch_count;
} Request;

/* support.c */
void fail(const char *format, ...);
void *zeros(long count, size_t size);
char *read_text(const char *path);

/* json.c */
const char *json_find(const char *value, const char *path);
const char *json_item(const char *value, int index);
void json_text(const char *value, char *out, size_t size);

/* npy.c */
void npy_read(const char *path, Array *array);
void npy_write(const char *path, const Array *array);

/* request.c: everything lives until the request is closed. An input or setting that is not there ends the program. */
void request_open(Request *request, const char *requests, const char *outputs, const char *name);
void request_close(Request *request);
const real *in_real(Request *request, const char *name);
const int64_t *in_integer(Request *request, const char *name);
const uint8_t *in_boolean(Request *request, const char *name);
long in_size(Request *request, const char *name, int axis); /* axis < 0 counts from the last */
double setting(const Request *request, const char *path);
bool setting_is(const Request *request, const char *path, const char *word);
void setting_text(const Request *request, const char *path, char *out, size_t size);
real *out_real(Request *request, const char *name, long count); /* zeros; written if the case asks for it */
int64_t *out_integer(Request *request, const char *name, long count);
uint64_t *out_unsigned(Request *request, const char *name, long count);
uint8_t *out_boolean(Request *request, const char *name, long count);
real *scratch(Request *request, long count);

/* Forward passes that `render` is made of; visible Gaussians only. */
void projected(Request *request, long n, uint8_t *visible, real *mean, real *cover, real *determinant, real *depth);
void coloured(Request *request, const real centre[3], long n, real *colour);

/* The operations, one function each. */
typedef void Operation(Request *request);
Operation reading, generator;                                                        /* reading.c */
Operation frequencies, dictionary, atoms, appearance, motion, matern, deformation;   /* time.c */
Operation laplacian, calibration;                                                    /* laplacian.c */
Operation covariance, projection;                                                    /* projection.c */
Operation harmonics;                                                                 /* harmonics.c */
Operation composite, render;                                                         /* composite.c */
Operation masked_l1, masked_ssim, normalised_depth, smoothness;                      /* losses.c */

#endif
