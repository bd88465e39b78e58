#include <stddef.h>
#include <stdint.h>

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
