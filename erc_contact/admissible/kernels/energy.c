/* The complementary energy of macro-elements as a quadratic form of facet moments, see tighten/complementary.py. */
#include "kernels.h"
#include "lanes.h"

enum { INPUTS = 72, VALUES = 336, MOMENTS = 6, BUBBLES = 18 };

/* y += A x for a sparse matrix A, or a full one, of these rows and columns. */
INLINE void sparse(int rows, int columns, const int *start, const int *column, const double *value, const lanes *x,
                   lanes *y)
{
  if (start[rows] == rows * columns)
    matrix_times(rows, columns, value, x, y);
  else
    for (int i = 0; i < rows; ++i)
      for (int k = start[i]; k < start[i + 1]; ++k)
        y[i] += value[k] * x[column[k]];
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

/* Solve A x = b for symmetric positive definite (N, N) matrices, lower triangles row by row; A is lost. */
INLINE void solve_definite(int N, lanes *A, lanes *x)
{
  for (int i = 0; i < N; ++i) {
    lanes *row = A + i * (i + 1) / 2;
    for (int j = 0; j <= i; ++j) {
      const lanes *other = A + j * (j + 1) / 2;
      lanes sum = row[j];
      for (int k = 0; k < j; ++k)
        sum -= row[k] * other[k];
      row[j] = j < i ? sum * other[j] : 1.0 / root(sum);
    }
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

/* Energy matrix of the bubbles: from the one metric of a cell, or from those at its Q points. */
INLINE void bubble_energy(const int s, int Q, int varies, int count, const double *bubbles, const double *products,
                          const lanes *metric, lanes *A)
{
  const int t = s * (s + 1) / 2;
  memset(A, 0, count * (count + 1) / 2 * sizeof(lanes));
  if (!varies)
    matrix_times(count * (count + 1) / 2, t, products, metric, A);
  for (int q = 0; q < Q && varies; ++q)
    for (int x = 0; x < count; ++x) {
      lanes bubble[6], dual[6];
      for (int a = 0; a < s; ++a)
        bubble[a] = bubbles[(q * s + a) * count + x] * ONE;
      metric_times(s, metric + q * t, bubble, dual);
      for (int y = 0; y <= x; ++y)
        for (int a = 0; a < s; ++a)
          A[x * (x + 1) / 2 + y] += bubbles[(q * s + a) * count + y] * dual[a];
    }
}

/* Strains of stresses (Q, s), weighted. */
INLINE void duals(const int s, int Q, int varies, const lanes *metric, const int *weight_start,
                  const int *weight_column, const double *weight, const lanes *stress, lanes *dual)
{
  lanes strain[VALUES];
  for (int q = 0; q < Q; ++q)
    metric_times(s, metric + (varies ? q * s * (s + 1) / 2 : 0), stress + q * s, strain + q * s);
  for (int q = 0; q < Q; ++q)
    for (int a = 0; a < s; ++a) {
      lanes sum = {0};
      for (int k = weight_start[q]; k < weight_start[q + 1]; ++k)
        sum += weight[k] * strain[weight_column[k] * s + a];
      dual[q * s + a] = sum;
    }
}

/* Coefficients of the reference tractions of a cell from their moments, less those of a constant stress. */
INLINE void reference_coefficients(const int d, int m, const lanes *sign, lanes (*inverse)[3], lanes volume,
                                   const double *facet_map, int has_mean, lanes (*push)[3], const lanes *input,
                                   lanes *coefficient)
{
  for (int f = 0; f <= d; ++f) {
    lanes gradient[3], reference[MOMENTS][3];
    for (int i = 0; i < d; ++i)
      gradient[i] = f ? inverse[f - 1][i] : d == 2 ? -inverse[0][i] - inverse[1][i]
                                                   : -inverse[0][i] - inverse[1][i] - inverse[2][i];
    for (int j = 0; j < m; ++j) {
      lanes moment[3];
      for (int i = 0; i < d; ++i) {
        moment[i] = sign[f] * input[(f * m + j) * d + i];
        if (has_mean && j < d)
          moment[i] += volume * dot(d, push[i], gradient);
      }
      for (int i = 0; i < d; ++i)
        reference[j][i] = dot(d, inverse[i], moment);
    }
    for (int j = 0; j < m; ++j)
      for (int i = 0; i < d; ++i) {
        lanes sum = {0};
        for (int k = 0; k < m; ++k)
          sum += facet_map[j * m + k] * reference[k][i];
        coefficient[(f * m + j) * d + i] = sum;
      }
  }
}

/* The transpose of reference_coefficients. */
INLINE void moments_back(const int d, int m, const lanes *sign, lanes (*inverse)[3], const double *facet_map,
                         const lanes *coefficient, lanes *input)
{
  for (int f = 0; f <= d; ++f) {
    lanes reference[MOMENTS][3];
    for (int k = 0; k < m; ++k)
      for (int i = 0; i < d; ++i) {
        lanes sum = {0};
        for (int j = 0; j < m; ++j)
          sum += facet_map[j * m + k] * coefficient[(f * m + j) * d + i];
        reference[k][i] = sum;
      }
    for (int k = 0; k < m; ++k)
      for (int i = 0; i < d; ++i) {
        lanes sum = {0};
        for (int r = 0; r < d; ++r)
          sum += inverse[r][i] * reference[k][r];
        input[(f * m + k) * d + i] = sign[f] * sum;
      }
  }
}

/* Take from the strains those of the bubbles of least energy. */
INLINE void relieve(const int s, int Q, int varies, int count, const double *bubbles, const double *products,
                    const lanes *metric, const int *weight_start, const int *weight_column, const double *weight,
                    lanes *dual)
{
  lanes A[BUBBLES * (BUBBLES + 1) / 2], amount[BUBBLES], added[VALUES], strain[VALUES];
  bubble_energy(s, Q, varies, count, bubbles, products, metric, A);
  memset(amount, 0, sizeof(amount));
  for (int i = 0; i < Q * s; ++i)
    for (int b = 0; b < count; ++b)
      amount[b] += bubbles[i * count + b] * dual[i];
  solve_definite(count, A, amount);
  memset(added, 0, sizeof(added));
  matrix_times(Q * s, count, bubbles, amount, added);
  duals(s, Q, varies, metric, weight_start, weight_column, weight, added, strain);
  for (int i = 0; i < Q * s; ++i)
    dual[i] -= strain[i];
}

INLINE double energy(const int d, int m, long long begin, long long end, const double *edges,
                     const int *facets, const long long *side, const double *compliance, int varies, int points,
                     const double *facet_map, int Q, const int *start, const int *column, const double *value,
                     const int *back_start, const int *back_column, const double *back_value,
                     const int *weight_start, const int *weight_column, const double *weight, int count,
                     const double *bubbles, const double *products, const double *x, const double *mean,
                     const double *offset, double *y)
{
  const int s = d * (d + 1) / 2, t = s * (s + 1) / 2, inputs = (d + 1) * m * d;
  double result = 0.0;
  for (long long first = begin; first < end; first += LANES) {
    const int here = end - first < LANES ? (int)(end - first) : LANES;
    lanes corner[3][3], inverse[3][3], metric[VALUES / 6 * 21], sign[4], input[INPUTS], coefficient[INPUTS];
    lanes stress[VALUES], dual[VALUES], push[3][3], C[36];
    for (int l = 0; l < LANES; ++l) {
      const long long cell = first + (l < here ? l : 0);
      for (int i = 0; i < d * d; ++i)
        corner[i / d][i % d][l] = edges[cell * d * d + i];
      for (int f = 0; f <= d; ++f) {
        const long long place = cell * (d + 1) + f;
        sign[f][l] = side[facets[place]] == place ? 1.0 : -1.0;
        for (int i = 0; i < m * d; ++i)
          input[f * m * d + i][l] = x[(long long)facets[place] * m * d + i];
      }
      for (int i = 0; i < d * d && mean; ++i)
        push[i / d][i % d][l] = mean[(cell - begin) * d * d + i];
      for (int i = 0; i < Q * s; ++i)
        stress[i][l] = offset ? offset[(cell - begin) * Q * s + i] : 0.0;
    }
    const lanes determinant = inverted(d, corner, inverse), volume = absolute(determinant) / (d == 2 ? 2.0 : 6.0);
    for (int q = 0; q < points; ++q) {
      for (int k = 0; k < s * s; ++k) {
        C[k] = compliance[q * s * s + k] * ONE;
        for (int l = 0; l < LANES && varies; ++l)
          C[k][l] = compliance[((first + (l < here ? l : 0)) * points + q) * s * s + k];
      }
      reference_metric(d, corner, determinant, C, metric + q * t);
    }
    reference_coefficients(d, m, sign, inverse, volume, facet_map, mean != NULL, push, input, coefficient);
    sparse(Q * s, inputs, start, column, value, coefficient, stress);
    duals(s, Q, points > 1, metric, weight_start, weight_column, weight, stress, dual);
    if (count)
      relieve(s, Q, points > 1, count, bubbles, products, metric, weight_start, weight_column, weight, dual);
    const lanes square = dot(Q * s, stress, dual);
    for (int l = 0; l < here; ++l)
      result += square[l];
    memset(coefficient, 0, sizeof(coefficient));
    sparse(inputs, Q * s, back_start, back_column, back_value, dual, coefficient);
    moments_back(d, m, sign, inverse, facet_map, coefficient, input);
    for (int l = 0; l < here; ++l)
      for (int f = 0; f <= d; ++f)
        for (int i = 0; i < m * d; ++i)
          y[(long long)facets[(first + l) * (d + 1) + f] * m * d + i] += input[f * m * d + i][l];
  }
  return result;
}

double macro_energy(int d, int m, long long begin, long long end, const double *edges, const int *facets,
                    const long long *side, const double *compliance, int varies, int points,
                    const double *facet_map, int Q, const int *start, const int *column, const double *value,
                    const int *back_start, const int *back_column, const double *back_value,
                    const int *weight_start, const int *weight_column, const double *weight, int count,
                    const double *bubbles, const double *products, const double *x, const double *mean,
                    const double *offset, double *y)
{
#define ENERGY(d) energy(d, m, begin, end, edges, facets, side, compliance, varies, points, facet_map, Q, start, \
    column, value, back_start, back_column, back_value, weight_start, weight_column, weight, count, bubbles, \
    products, x, mean, offset, y)
  return d == 2 ? ENERGY(2) : ENERGY(3);
}
