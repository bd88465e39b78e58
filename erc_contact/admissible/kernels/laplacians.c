/* Graph Laplacians of the cells around each node, see admissible/facets.py. */
#include "kernels.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Solve A x = b for a symmetric positive definite (N, N) matrix and the chosen columns of b, shape (N, d), in place.
   Only the lower triangle of A is read; it is lost. */
static void solve_columns(int N, double *A, int d, const _Bool *chosen, double *b)
{
  for (int i = 0; i < N; ++i) {
    double *row = A + i * N;
    for (int j = 0; j <= i; ++j) {
      const double *other = A + j * N;
      double sum = row[j];
      for (int k = 0; k < j; ++k)
        sum -= row[k] * other[k];
      row[j] = j < i ? sum * other[j] : 1 / sqrt(sum);
    }
    for (int c = 0; c < d; ++c)
      if (chosen[c]) {
        double sum = b[i * d + c];
        for (int j = 0; j < i; ++j)
          sum -= row[j] * b[j * d + c];
        b[i * d + c] = sum * row[i];
      }
  }
  for (int i = N - 1; i >= 0; --i)
    for (int c = 0; c < d; ++c)
      if (chosen[c]) {
        b[i * d + c] *= A[i * N + i];
        for (int j = 0; j < i; ++j)
          b[j * d + c] -= A[i * N + j] * b[i * d + c];
      }
}

/* The members (cell, node) of each node that is complete, one node after the other, and the place of each of them, -1
   for others. Returns the size of the largest patch. */
static int members(long long count, const int *node, long long nodes, const _Bool *complete, int *start, int *member,
                   int *place)
{
  int largest = 0;
  memset(start, 0, (nodes + 1) * sizeof(int));
  for (long long a = 0; a < count; ++a)
    if (complete[node[a]])
      ++start[node[a] + 1];
  for (long long v = 0; v < nodes; ++v) {
    largest = start[v + 1] > largest ? start[v + 1] : largest;
    start[v + 1] += start[v];
  }
  for (long long a = 0; a < count; ++a) {
    place[a] = -1;
    if (complete[node[a]]) {
      place[a] = start[node[a]]++;
      member[place[a]] = (int)a;
    }
  }
  memmove(start + 1, start, nodes * sizeof(int));
  start[0] = 0;
  for (long long a = 0; a < count; ++a)
    if (place[a] >= 0)
      place[a] -= start[node[a]];
  return largest;
}

/* The graph Laplacian of a patch of some members, and what their facets of Gamma_D add to its diagonal. */
static void assemble(int d, int N, int m, long long F, int size, const int *here, const int *facets,
                     const long long *side, const int *on_facet, const double *weight, const _Bool *fixed,
                     const int *place, double *A, double *ground)
{
  memset(A, 0, (size_t)size * size * sizeof(double));
  memset(ground, 0, (size_t)size * d * sizeof(double));
  for (int a = 0; a < size; ++a) {
    const long long cell = here[a] / N;
    const int local = here[a] % N;
    for (int i = 0; i <= d; ++i)
      for (int t = 0; t < m; ++t) {
        if (on_facet[i * m + t] != local)
          continue;
        const long long own = cell * (d + 1) + i, facet = facets[own];
        const long long other = side[facet] == own ? side[F + facet] : side[facet];
        if (other != own) {
          const long long b = other / (d + 1) * N + on_facet[other % (d + 1) * m + t];
          A[a * size + a] += weight[facet];
          A[a * size + place[b]] -= weight[facet];
        } else
          for (int c = 0; c < d; ++c)
            ground[a * d + c] += fixed[facet * d + c] ? weight[facet] : 0.0;
      }
  }
}

int patch_jumps(int N, int m, long long cells, long long nodes, long long F, const int *node,
                const int *facets, const long long *side, const int *on_facet, const double *weight,
                const _Bool *fixed, const _Bool *complete, int *start, int *member, int *place, double *lambda)
{
  const int d = DIMENSION;
  const int largest = members(cells * N, node, nodes, complete, start, member, place);
  double *A = malloc((2 * (size_t)largest * largest + 2 * (size_t)largest * d) * sizeof(double));
  if (!A)
    return -1;
  double *matrix = A + (size_t)largest * largest, *ground = matrix + (size_t)largest * largest;
  double *right = ground + (size_t)largest * d;
  for (long long v = 0; v < nodes; ++v) {
    const int size = start[v + 1] - start[v], *here = member + start[v];
    assemble(d, N, m, F, size, here, facets, side, on_facet, weight, fixed, place, A, ground);
    for (int a = 0; a < size; ++a)
      memcpy(right + a * d, lambda + (long long)here[a] * d, d * sizeof(double));
    double trace = 0.0;
    for (int a = 0; a < size; ++a)
      trace += A[a * size + a];
    _Bool done[3] = {0};
    for (int c = 0; c < d; ++c) {
      if (done[c])
        continue;
      _Bool chosen[3] = {0};
      for (int e = c; e < d; ++e) {
        chosen[e] = 1;
        for (int a = 0; a < size; ++a)
          chosen[e] &= ground[a * d + e] == ground[a * d + c];
        done[e] |= chosen[e];
      }
      double grounded = 0.0;
      for (int a = 0; a < size; ++a)
        grounded += ground[a * d + c];
      const double mean = grounded > 0 ? 0.0 : size > 1 ? trace / size / size : 1.0;
      for (int k = 0; k < size * size; ++k)
        matrix[k] = A[k] + mean;
      for (int a = 0; a < size; ++a)
        matrix[a * size + a] += ground[a * d + c];
      solve_columns(size, matrix, d, chosen, right);
    }
    for (int a = 0; a < size; ++a)
      memcpy(lambda + (long long)here[a] * d, right + a * d, d * sizeof(double));
  }
  free(A);
  return 0;
}
