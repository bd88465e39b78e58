/* The complementary energy of each cell as a dense matrix, see tighten/complementary.py. */
#include "kernels.h"
#include "bubbles.h"

/* The Schur complement that is left at two of the last rows and columns, each the first of d. */
INLINE void complement(const int d, int count, const lanes *A, int row, int column, lanes (*block)[3])
{
  const lanes *of_row[3], *of_column[3];
  for (int r = 0; r < d; ++r) {
    of_row[r] = A + (row + r) * (row + r + 1) / 2;
    of_column[r] = A + (column + r) * (column + r + 1) / 2;
  }
  for (int r = 0; r < d; ++r)
    for (int c = 0; c < d; ++c)
      block[r][c] = row + r < column + c ? of_column[c][row + r] : of_row[r][column + c];
  for (int k = 0; k < count; ++k)
    for (int r = 0; r < d; ++r)
      for (int c = 0; c < d; ++c)
        block[r][c] -= of_row[r][k] * of_column[c][k];
}

/* Energies of moments: what the bubbles leave of the energies of reference moments, the last of N unknowns. */
INLINE void push_forward(const int d, int count, int N, lanes (*inverse)[3], const lanes *A, lanes *energies)
{
  for (int p = 0; p < N - count; p += d)
    for (int q = 0; q <= p; q += d) {
      lanes block[3][3], half[3][3];
      complement(d, count, A, count + p, count + q, block);
      for (int r = 0; r < d; ++r)
        for (int c = 0; c < d; ++c) {
          half[r][c] = block[r][0] * inverse[0][c];
          for (int k = 1; k < d; ++k)
            half[r][c] += block[r][k] * inverse[k][c];
        }
      for (int r = 0; r < d; ++r)
        for (int c = 0; c < d && q + c <= p + r; ++c) {
          lanes sum = inverse[0][r] * half[0][c];
          for (int k = 1; k < d; ++k)
            sum += inverse[k][r] * half[k][c];
          energies[(p + r) * (p + r + 1) / 2 + q + c] = sum;
        }
    }
}

/* Write a matrix with 1 on its diagonal, in multiples of 2^-30, and the roots of its diagonal before. The sum with
   1.5 * 2^52 has no digits after the point. */
INLINE void write_scaled(int inputs, const lanes *energies, int *matrix, lanes *roots)
{
  lanes share[INPUTS];
  for (int i = 0; i < inputs; ++i) {
    roots[i] = root(energies[i * (i + 1) / 2 + i]);
    share[i] = 0x1p15 / roots[i];
  }
  for (int i = 0; i < inputs; ++i)
    for (int j = 0; j <= i; ++j, ++energies, matrix += LANES)
      *(digits *)matrix = __builtin_convertvector((share[i] * share[j] * *energies + 0x1.8p52) - 0x1.8p52, digits);
}

/* Tell whether all cells have the same metric at all of their points, as bodies have where they do not yield. */
INLINE int is_uniform(int points, int entries, const lanes *metric)
{
  for (int i = entries; i < points * entries; ++i)
    for (int l = 0; l < LANES; ++l)
      if (metric[i][l] != metric[i % entries][l])
        return 0;
  return 1;
}

int energy_matrices(int m, long long cells, const double *edges, const int *facets, const long long *side,
                    const double *compliance, int varies, int points, int Q, int count, const double *functions,
                    const double *products, int *matrix, double *scale)
{
  const int d = DIMENSION, s = d * (d + 1) / 2, inputs = (d + 1) * m * d, N = inputs + count;
  lanes *A = aligned_alloc(sizeof(lanes), N * (N + 1) * sizeof(lanes)), *energies = A + N * (N + 1) / 2;
  if (!A)
    return -1;
  for (long long first = 0; first < cells; first += LANES) {
    lanes corner[3][3], inverse[3][3], metric[21 * POINTS], roots[INPUTS];
    for (int l = 0; l < LANES; ++l)
      for (int i = 0; i < d * d; ++i)
        corner[i / d][i % d][l] = edges[cell_of(first, l, cells) * d * d + i];
    const lanes determinant = inverted(d, corner, inverse);
    metrics(d, first, 0, cells, corner, determinant, compliance, varies, points, metric);
    energy_matrix(s, Q, !is_uniform(points, s * (s + 1) / 2, metric), N, functions, products, metric, A);
    eliminate(count, N, A);
    push_forward(d, count, N, inverse, A, energies);
    write_scaled(inputs, energies, matrix, roots);
    matrix += (size_t)inputs * (inputs + 1) / 2 * LANES;
    /* The sign of a moment is its sign on the first side of the facet. Lanes beyond the last cell count for nothing. */
    for (int i = 0; i < inputs; ++i, scale += LANES)
      for (int l = 0; l < LANES; ++l) {
        const long long place = cell_of(first, l, cells) * (d + 1) + i / (m * d);
        const double sign = side[facets[place]] == place ? 1.0 : -1.0;
        scale[l] = first + l < cells ? sign * 0x1p-15 * roots[i][l] : 0.0;
      }
  }
  free(A);
  return 0;
}

double matrix_energy(int m, long long cells, const int *facets, const int *matrix, const double *scale, const double *x,
                     double *y)
{
  const int d = DIMENSION, inputs = (d + 1) * m * d;
  double result = 0.0;
  for (long long first = 0; first < cells; first += LANES, scale += inputs * LANES) {
    lanes input[INPUTS], output[INPUTS], square = {0};
    for (int i = 0; i < inputs; ++i)
      for (int l = 0; l < LANES; ++l) {
        const long long facet = facets[cell_of(first, l, cells) * (d + 1) + i / (m * d)];
        input[i][l] = scale[i * LANES + l] * x[facet * m * d + i % (m * d)];
      }
    for (int i = 0; i < inputs; ++i) {
      lanes sum = {0};
      const digits *row = (const digits *)matrix;
      for (int j = 0; j < i; ++j) {
        const lanes entry = WIDE(row[j]);
        sum += entry * input[j];
        output[j] += entry * input[i];
      }
      output[i] = sum + WIDE(row[i]) * input[i];
      matrix += (i + 1) * LANES;
    }
    for (int i = 0; i < inputs; ++i) {
      square += input[i] * output[i];
      for (int l = 0; l < LANES && first + l < cells; ++l) {
        const long long facet = facets[(first + l) * (d + 1) + i / (m * d)];
        y[facet * m * d + i % (m * d)] += scale[i * LANES + l] * output[i][l];
      }
    }
    for (int l = 0; l < LANES; ++l)
      result += square[l];
  }
  return result;
}
