/* The kernels of values at points. Python reads these lines, too. Arrays are contiguous. */

/* expressions.py: evaluates an expression that FFCx has compiled, by its address, at points: values (n, size) of numbers
   (n, width) and constants. It adds to the values. */
void at_points(long long tabulate, int n, int size, double *values, int width, const double *numbers,
               const double *constants);

/* expressions.py: multiplies square matrices of such an expression, (size, size) at each point, and vectors (n, size). */
void times_at_points(long long tabulate, int n, int size, double *products, const double *vectors, int width,
                     const double *numbers, const double *constants);

/* expressions.py: replaces symmetric definite matrices (n, s, s) by their inverses. */
void invert_definite(long long n, int s, double *matrices);
