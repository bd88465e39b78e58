/* The kernels of sparse matrices. Python reads these lines, too. Arrays are contiguous. */

/* sparse.py: sets y to the product of a symmetric matrix with x. The matrix is given by the rows of its blocks on and
   right of the diagonal: start, column, block (n, d, d). */
void half_product(int rows, const int *start, const int *column, const double *block, const double *x, double *y);
