/* Stresses of macro-elements without tractions and divergence, the bubbles, see tighten/complementary.py. */
#ifndef BUBBLES_H
#define BUBBLES_H

#include "lanes.h"

enum { POINTS = 56, VALUES = 6 * POINTS, BUBBLES = 18, INPUTS = 72 };

/* Stresses |det J| J^-1 sigma J^-T of the reference simplex, in place, from some sigma in Mandel components. */
INLINE void pull_back(const int d, lanes (*inverse)[3], lanes determinant, int count, lanes *stress)
{
  const int s = d * (d + 1) / 2;
  const lanes size = absolute(determinant);
  lanes columns[3][3], R[6][6], sigma[6];
  for (int i = 0; i < d; ++i)
    for (int r = 0; r < d; ++r)
      columns[i][r] = inverse[r][i];
  images(d, columns, R);
  for (int q = 0; q < count; ++q) {
    memcpy(sigma, stress + q * s, s * sizeof(lanes));
    for (int r = 0; r < s; ++r) {
      lanes sum = {0};
      for (int a = 0; a < s; ++a)
        sum += sigma[a] * R[a][r];
      stress[q * s + r] = size * sum;
    }
  }
}

/* y += A x for a sparse matrix A of these rows and vectors of s components. */
INLINE void spread(const int s, int rows, const int *start, const int *column, const double *value, const lanes *x,
                   lanes *y)
{
  for (int q = 0; q < rows; ++q) {
    lanes sum[6] = {{0}};
    for (int k = start[q]; k < start[q + 1]; ++k)
      for (int a = 0; a < s; ++a)
        sum[a] += value[k] * x[column[k] * s + a];
    for (int a = 0; a < s; ++a)
      y[q * s + a] += sum[a];
  }
}

/* Product of a metric, entries a <= b one after the other, and a vector (s,). */
INLINE void metric_times(const int s, const lanes *metric, const lanes *x, lanes *y)
{
  for (int a = 0; a < s; ++a)
    y[a] = x[a] * 0.0;
  for (int a = 0; a < s; ++a)
    for (int b = a; b < s; ++b, ++metric) {
      y[a] += *metric * x[b];
      if (b > a)
        y[b] += *metric * x[a];
    }
}

/* Eliminate the first unknowns of symmetric matrices (N, N), lower triangles row by row: a part of a Cholesky factor takes
   the place of their columns. */
INLINE void eliminate(int count, int N, lanes *A)
{
  for (int i = 0; i < N; ++i) {
    lanes *row = A + i * (i + 1) / 2;
    const int first = i < count ? i : count;
    for (int j = 0; j < first; ++j) {
      const lanes *other = A + j * (j + 1) / 2;
      row[j] = (row[j] - product(j, row, other)) * other[j];
    }
    if (i < count)
      row[i] = 1.0 / root(row[i] - product(i, row, row));
  }
}

/* Solve A x = b for symmetric positive definite (N, N) matrices, lower triangles row by row; A is lost. */
INLINE void solve_definite(int N, lanes *A, lanes *x)
{
  eliminate(N, N, A);
  for (int i = 0; i < N; ++i) {
    const lanes *row = A + i * (i + 1) / 2;
    lanes sum = x[i];
    for (int j = 0; j < i; ++j)
      sum -= row[j] * x[j];
    x[i] = sum * row[i];
  }
  for (int i = N - 1; i >= 0; --i) {
    const lanes *row = A + i * (i + 1) / 2;
    x[i] *= row[i];
    for (int j = 0; j < i; ++j)
      x[j] -= row[j] * x[i];
  }
}

/* Points whose energies are summed at once, so that the strains there stay in the cache; rows and columns of a tile. */
enum { AT_ONCE = 4, TILE = 3, MOST_FUNCTIONS = INPUTS + BUBBLES };

/* Products of some columns (N, K) and the rows of a table (K, N), added to lower triangles row by row; N is a multiple of
   TILE. */
INLINE void add_products(int N, int K, const lanes *columns, const double *table, lanes *A)
{
  for (int x = 0; x < N; x += TILE)
    for (int y = 0; y <= x; y += TILE) {
      lanes sum[TILE][TILE] = {{{0}}};
      for (int k = 0; k < K; ++k)
        for (int i = 0; i < TILE; ++i)
          for (int j = 0; j < TILE; ++j)
            sum[i][j] += columns[(x + i) * K + k] * table[k * N + y + j];
      for (int i = 0; i < TILE; ++i)
        for (int j = 0; j < TILE && y + j <= x + i; ++j)
          A[(x + i) * (x + i + 1) / 2 + y + j] += sum[i][j];
    }
}

/* Energy matrix of some stresses, as of bubbles: from the one metric of a cell, or from those at its Q points. */
INLINE void energy_matrix(const int s, int Q, int varies, int count, const double *functions, const double *products,
                          const lanes *metric, lanes *A)
{
  const int t = s * (s + 1) / 2;
  memset(A, 0, count * (count + 1) / 2 * sizeof(lanes));
  if (!varies)
    matrix_times(count * (count + 1) / 2, t, products, metric, A);
  for (int first = 0; first < Q && varies; first += AT_ONCE) {
    const int here = Q - first < AT_ONCE ? Q - first : AT_ONCE;
    lanes strain[MOST_FUNCTIONS * AT_ONCE * 6];
    for (int x = 0; x < count; ++x)
      for (int q = 0; q < here; ++q) {
        lanes stress[6];
        for (int a = 0; a < s; ++a)
          stress[a] = functions[((first + q) * s + a) * count + x] * ONE;
        metric_times(s, metric + (first + q) * t, stress, strain + (x * here + q) * s);
      }
    add_products(count, here * s, strain, functions + first * s * count, A);
  }
}

/* Strains of stresses (Q, s), weighted. */
INLINE void duals(const int s, int Q, int varies, const lanes *metric, const int *weight_start,
                  const int *weight_column, const double *weight, const lanes *stress, lanes *dual)
{
  lanes strain[VALUES];
  for (int q = 0; q < Q; ++q)
    metric_times(s, metric + (varies ? q * s * (s + 1) / 2 : 0), stress + q * s, strain + q * s);
  memset(dual, 0, Q * s * sizeof(lanes));
  spread(s, Q, weight_start, weight_column, weight, strain, dual);
}

/* Amounts of the bubbles that do the work dual.bubbles, from their energies in the metric. */
INLINE void amounts(const int groups, const int s, int Q, int varies, int count, const double *bubbles,
                    const double *transposed, const double *products, const lanes *const *metric,
                    const lanes *const *dual, lanes *const *amount)
{
  for (int g = 0; g < groups; ++g)
    memset(amount[g], 0, count * sizeof(lanes));
  if (groups == 1)
    matrix_times(count, Q * s, transposed, dual[0], amount[0]);
  else
    matrix_times_groups(count, Q * s, transposed, dual, amount);
  for (int g = 0; g < groups; ++g) {
    lanes A[BUBBLES * (BUBBLES + 1) / 2];
    energy_matrix(s, Q, varies, count, bubbles, products, metric[g], A);
    solve_definite(count, A, amount[g]);
  }
}
#endif
