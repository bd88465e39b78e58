#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "kernels.h"

/* How FFCx compiles an expression: values, coefficients, constants, coordinates, facet, permutation, data. */
typedef void (*expression)(double *, const double *, const double *, const double *, const int *, const unsigned char *,
                           void *);

void at_points(long long tabulate, int n, int size, double *values, int width, const double *numbers,
               const double *constants)
{
    const expression at = (expression)(intptr_t)tabulate;
    for (int i = 0; i < n; i++)
        at(values + (size_t)i * size, numbers + (size_t)i * width, constants, NULL, NULL, NULL, NULL);
}

/* The matrix of a point is used at once, and written nowhere. */
void times_at_points(long long tabulate, int n, int size, double *products, const double *vectors, int width,
                     const double *numbers, const double *constants)
{
    const expression at = (expression)(intptr_t)tabulate;
    double matrix[size][size];
    for (int i = 0; i < n; i++) {
        const double *vector = vectors + (size_t)i * size;
        memset(matrix, 0, sizeof matrix);
        at(matrix[0], numbers + (size_t)i * width, constants, NULL, NULL, NULL, NULL);
        for (int row = 0; row < size; row++) {
            double product = 0.0;
            for (int column = 0; column < size; column++)
                product += matrix[row][column] * vector[column];
            products[(size_t)i * size + row] = product;
        }
    }
}

/* In place, by Gauss and Jordan. Definite matrices need no other pivots. */
void invert_definite(long long n, int s, double *matrices)
{
    for (double *A = matrices; A < matrices + n * s * s; A += s * s)
        for (int k = 0; k < s; k++) {
            const double pivot = 1.0 / A[k * s + k];
            A[k * s + k] = 1.0;
            for (int j = 0; j < s; j++)
                A[k * s + j] *= pivot;
            for (int i = 0; i < s; i++) {
                const double factor = i == k ? 0.0 : A[i * s + k];
                if (i != k)
                    A[i * s + k] = 0.0;
                for (int j = 0; j < s; j++)
                    A[i * s + j] -= factor * A[k * s + j];
            }
        }
}
