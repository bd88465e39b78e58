/* Inverses of the small problems of complementary energy on facets, see tighten/blocks.py. */
#include "kernels.h"
#include "lanes.h"

enum { SIZE = 9, ENTRIES = SIZE * (SIZE + 1) / 2 };

/* Add the energies of the quadratic moments of all facets of all cells to the matrices (F, N, N). */
INLINE void assemble(const int d, const int j, long long cells, const double *edges, const int *facets,
                     const double *compliance, int varies, const double *table, double *matrices)
{
  const int s = d * (d + 1) / 2, N = j * d, entries = N * (N + 1) / 2;
  for (long long first = 0; first < cells; first += LANES) {
    const int here = cells - first < LANES ? (int)(cells - first) : LANES;
    lanes x[3][3], inverse[3][3], metric[21], energy[4 * ENTRIES] = {{0}};
    for (int l = 0; l < LANES; ++l)
      for (int i = 0; i < d * d; ++i)
        x[i / d][i % d][l] = edges[cell_of(first, l, cells) * d * d + i];
    const lanes determinant = inverted(d, x, inverse);
    metrics(d, first, 0, cells, x, determinant, compliance, varies, 1, metric);
    matrix_times((d + 1) * entries, s * (s + 1) / 2, table, metric, energy);
    for (int f = 0; f <= d; ++f) {
      /* The Jacobian maps both moments: the columns first, then the rows. */
      lanes half[SIZE][SIZE], full[SIZE][SIZE];
      for (int p = 0; p < N; ++p)
        for (int q = 0; q < N; ++q)
          full[p][q] = energy[f * entries + (p > q ? p * (p + 1) / 2 + q : q * (q + 1) / 2 + p)];
      for (int p = 0; p < N; ++p)
        for (int q = 0; q < N; ++q) {
          lanes sum = {0};
          for (int r = 0; r < d; ++r)
            sum += full[p][q / d * d + r] * inverse[r][q % d];
          half[p][q] = sum;
        }
      for (int p = 0; p < N; ++p)
        for (int q = 0; q < N; ++q) {
          lanes sum = {0};
          for (int r = 0; r < d; ++r)
            sum += half[p / d * d + r][q] * inverse[r][p % d];
          full[p][q] = sum;
        }
      for (int l = 0; l < here; ++l) {
        double *to = matrices + (size_t)facets[(first + l) * (d + 1) + f] * N * N;
        for (int p = 0; p < N; ++p)
          for (int q = 0; q < N; ++q)
            to[p * N + q] += full[p][q][l];
      }
    }
  }
}

/* Replace a symmetric positive definite matrix (N, N) by its inverse times a weight, zero where keep is not. */
INLINE void invert(const int N, double weight, const _Bool *keep, double *A)
{
  double L[SIZE][SIZE], columns[SIZE][SIZE] = {{0}};
  for (int p = 0; p < N; ++p)
    for (int q = 0; q <= p; ++q)
      L[p][q] = keep[p] && keep[q] ? A[p * N + q] : p == q ? 1.0 : 0.0;
  for (int p = 0; p < N; ++p)
    for (int q = 0; q <= p; ++q) {
      double sum = L[p][q];
      for (int k = 0; k < q; ++k)
        sum -= L[p][k] * L[q][k];
      L[p][q] = q < p ? sum * L[q][q] : 1.0 / sqrt(sum);
    }
  /* Columns of L^-1; the inverse is its square. */
  for (int c = 0; c < N; ++c)
    for (int p = c; p < N; ++p) {
      double sum = p == c ? 1.0 : 0.0;
      for (int k = c; k < p; ++k)
        sum -= L[p][k] * columns[k][c];
      columns[p][c] = sum * L[p][p];
    }
  for (int p = 0; p < N; ++p)
    for (int q = 0; q < N; ++q) {
      double sum = 0.0;
      for (int k = p > q ? p : q; k < N; ++k)
        sum += columns[k][p] * columns[k][q];
      A[p * N + q] = keep[p] && keep[q] ? weight * sum : 0.0;
    }
}

INLINE void blocks(const int d, const int j, long long cells, const double *edges, const int *facets,
                   const double *compliance, int varies, const double *table, long long F, const _Bool *free,
                   const _Bool *mine, double *matrices)
{
  const int N = j * d;
  assemble(d, j, cells, edges, facets, compliance, varies, table, matrices);
  for (long long f = 0; f < F; ++f) {
    double *A = matrices + (size_t)f * N * N;
    _Bool keep[SIZE];
    /* Components without energy have no equation. */
    for (int p = 0; p < N; ++p)
      keep[p] = free[f * d + p % d] && mine[f] && A[p * N + p] > 0.0;
    invert(N, d, keep, A);
  }
}

void facet_blocks(long long cells, const double *edges, const int *facets, const double *compliance,
                  int varies, const double *table, long long F, const _Bool *free, const _Bool *mine,
                  double *matrices)
{
  const int count = DIMENSION == 2 ? 1 : 3;
  blocks(DIMENSION, count, cells, edges, facets, compliance, varies, table, F, free, mine, matrices);
}
