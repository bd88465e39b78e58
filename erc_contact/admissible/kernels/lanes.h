/* Values of LANES cells or patches side by side, written like one value; the compiler makes vectors of them. */
#ifndef LANES_H
#define LANES_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* As many as a vector of the processor holds. With twice as many its registers do not suffice: the estimator takes more
   than twice the time. */
#ifdef __AVX512F__
enum { LANES = 8 };
#else
enum { LANES = 4 };
#endif
typedef double lanes __attribute__((vector_size(8 * LANES)));
typedef int digits __attribute__((vector_size(4 * LANES), aligned(4), may_alias));
typedef float units __attribute__((vector_size(4 * LANES), aligned(4), may_alias));

#define ONE (1.0 - (lanes){0})
#define INLINE static inline __attribute__((always_inline))
#define ONCE static __attribute__((noinline, unused))

#define WIDE(x) __builtin_convertvector(x, lanes)

INLINE lanes root(lanes x)
{
  for (int l = 0; l < LANES; ++l)
    x[l] = sqrt(x[l]);
  return x;
}

INLINE lanes absolute(lanes x)
{
  for (int l = 0; l < LANES; ++l)
    x[l] = fabs(x[l]);
  return x;
}

INLINE lanes dot(const int d, const lanes *a, const lanes *b)
{
  lanes sum = a[0] * b[0];
  for (int i = 1; i < d; ++i)
    sum += a[i] * b[i];
  return sum;
}

/* Scalar product of long vectors; two sums at once hide how long each of them takes. */
INLINE lanes product(int count, const lanes *a, const lanes *b)
{
  lanes sum = {0}, odd = {0};
  int k = 0;
  for (; k + 1 < count; k += 2) {
    sum += a[k] * b[k];
    odd += a[k + 1] * b[k + 1];
  }
  if (k < count)
    sum += a[k] * b[k];
  return sum + odd;
}

/* Groups of lanes that one pass over a table serves: more of them, or of rows, and the registers do not suffice. */
enum { GROUPS = 2, ROWS = 6 };

/* y += A x for count rows of a matrix and all groups; that many sums at once hide how long each of them takes. */
INLINE void rows_times(const int groups, const int count, int columns, const double *A, const lanes *const *x,
                       lanes *const *y, int first)
{
  lanes sum[ROWS][GROUPS] = {{{0}}};
  for (int k = 0; k < columns; ++k)
    for (int i = 0; i < count; ++i)
      for (int g = 0; g < groups; ++g)
        sum[i][g] += A[i * columns + k] * x[g][k];
  for (int i = 0; i < count; ++i)
    for (int g = 0; g < groups; ++g)
      y[g][first + i] += sum[i][g];
}

/* y += A x for a matrix (rows, columns) that is the same in all lanes; the number of rows is a multiple of 3. */
INLINE void all_rows_times(const int groups, int rows, int columns, const double *A, const lanes *const *x,
                           lanes *const *y)
{
  int i = 0;
  for (; i + ROWS <= rows; i += ROWS)
    rows_times(groups, ROWS, columns, A + i * columns, x, y, i);
  if (i < rows)
    rows_times(groups, ROWS / 2, columns, A + i * columns, x, y, i);
}

/* The same for one group and for all, each compiled once in a file. */
ONCE void matrix_times(int rows, int columns, const double *A, const lanes *x, lanes *y)
{
  all_rows_times(1, rows, columns, A, &x, &y);
}

ONCE void matrix_times_groups(int rows, int columns, const double *A, const lanes *const *x, lanes *const *y)
{
  all_rows_times(GROUPS, rows, columns, A, x, y);
}

/* Normal to d - 1 vectors, in the sense in which they follow each other; as long as their parallelotope is large. */
INLINE void across(const int d, const lanes *a, const lanes *b, lanes *n)
{
  if (d == 2) {
    n[0] = -a[1];
    n[1] = a[0];
  } else
    for (int i = 0; i < 3; ++i)
      n[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

/* Inverse Jacobian, shape (d, d), and determinant, from the edges x of a cell, shape (d, d): edge, component. */
INLINE lanes inverted(const int d, lanes (*x)[3], lanes (*inverse)[3])
{
  if (d == 2) {
    across(2, x[1], NULL, inverse[0]);
    across(2, x[0], NULL, inverse[1]);
    for (int j = 0; j < 2; ++j)
      inverse[0][j] = -inverse[0][j];
  } else
    for (int i = 0; i < 3; ++i)
      across(3, x[(i + 1) % 3], x[(i + 2) % 3], inverse[i]);
  const lanes determinant = dot(d, x[0], inverse[0]);
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j)
      inverse[i][j] /= determinant;
  return determinant;
}

/* Images J b J^T of the tensors b of Mandel's basis in Mandel components, row by row, shape (s, s). */
INLINE void images(const int d, lanes (*x)[3], lanes (*P)[6])
{
  static const int first[2][6] = {{0, 1, 0}, {0, 1, 2, 0, 0, 1}}, second[2][6] = {{0, 1, 1}, {0, 1, 2, 1, 2, 2}};
  const int s = d * (d + 1) / 2, *one = first[d - 2], *two = second[d - 2];
  for (int a = 0; a < s; ++a)
    for (int b = 0; b < s; ++b) {
      const lanes *k = x[one[a]], *l = x[two[a]];
      const int i = one[b], j = two[b];
      if (a < d)
        P[a][b] = (b < d ? 1.0 : M_SQRT2) * k[i] * k[j];
      else
        P[a][b] = (b < d ? M_SQRT1_2 : 1.0) * (k[i] * l[j] + k[j] * l[i]);
    }
}

/* |T| P C^-1 P^T, the compliance for reference stresses, entries a <= b one after the other. */
INLINE void reference_metric(const int d, lanes (*x)[3], lanes determinant, const lanes *compliance, lanes *metric)
{
  const int s = d * (d + 1) / 2;
  lanes P[6][6], row[6];
  images(d, x, P);
  const lanes weight = 1.0 / (absolute(determinant) * (d == 2 ? 2.0 : 6.0));
  for (int a = 0; a < s; ++a) {
    for (int k = 0; k < s; ++k)
      row[k] = weight * dot(s, P[a], compliance + k * s);
    for (int b = a; b < s; ++b)
      *metric++ = dot(s, row, P[b]);
  }
}

/* The cell of a lane; lanes beyond the last cell repeat the first one. */
INLINE long long cell_of(long long first, int lane, long long cells)
{
  return first + lane < cells ? first + lane : first;
}

/* Compliances for reference stresses of the cells of LANES lanes from this one on, at their points. */
INLINE void metrics(const int d, long long first, int lane, long long cells, lanes (*corner)[3], lanes determinant,
                    const double *compliance, int varies, int points, lanes *metric)
{
  const int s = d * (d + 1) / 2, t = s * (s + 1) / 2;
  lanes C[36];
  for (int q = 0; q < points; ++q) {
    for (int k = 0; k < s * s; ++k) {
      C[k] = compliance[q * s * s + k] * ONE;
      for (int l = 0; l < LANES && varies; ++l)
        C[k][l] = compliance[(cell_of(first, lane + l, cells) * points + q) * s * s + k];
    }
    reference_metric(d, corner, determinant, C, metric + q * t);
  }
}
#endif
