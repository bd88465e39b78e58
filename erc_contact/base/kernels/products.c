#include "kernels.h"

void half_product(int rows, const int *start, const int *column, const double *block, const double *x, double *y)
{
    for (int i = 0; i < rows * DIMENSION; i++)
        y[i] = 0.0;
    for (int row = 0; row < rows; row++) {
        const double *here = x + row * DIMENSION;
        double sum[DIMENSION] = {0.0};
        for (int k = start[row]; k < start[row + 1]; k++) {
            const double *values = block + (long long)k * DIMENSION * DIMENSION;
            const double *there = x + column[k] * DIMENSION;
            double *below = y + column[k] * DIMENSION;
            for (int i = 0; i < DIMENSION; i++)
                for (int j = 0; j < DIMENSION; j++)
                    sum[i] += values[i * DIMENSION + j] * there[j];
            if (column[k] == row)
                continue;
            /* The block below the diagonal is the transposed one. */
            for (int j = 0; j < DIMENSION; j++) {
                double more = below[j];
                for (int i = 0; i < DIMENSION; i++)
                    more += values[i * DIMENSION + j] * here[i];
                below[j] = more;
            }
        }
        for (int i = 0; i < DIMENSION; i++)
            y[row * DIMENSION + i] += sum[i];
    }
}
