/* Graph Laplacians of the cells around each node, see admissible/facets.py, strains and stresses of cells. */
#include "kernels.h"
#include "lanes.h"

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

int patch_jumps(int d, int N, int m, long long cells, long long nodes, long long F, const int *node,
                const int *facets, const long long *side, const int *on_facet, const double *weight,
                const _Bool *fixed, const _Bool *complete, int *start, int *member, int *place, double *lambda)
{
  const int largest = members(cells * N, node, nodes, complete, start, member, place);
  double *A = malloc((2 * (size_t)largest * largest + 2 * (size_t)largest * d) * sizeof(double));
  if (!A)
    return -1;
  double *matrix = A + (size_t)largest * largest, *ground = matrix + (size_t)largest * largest;
  double *right = ground + (size_t)largest * d;
  for (long long v = 0; v < nodes; ++v) {
    const int size = start[v + 1] - start[v], *here = member + start[v];
    memset(A, 0, (size_t)size * size * sizeof(double));
    memset(ground, 0, (size_t)size * d * sizeof(double));
    for (int a = 0; a < size; ++a) {
      const long long cell = here[a] / N;
      const int local = here[a] % N;
      memcpy(right + a * d, lambda + (long long)here[a] * d, d * sizeof(double));
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


INLINE void strains(const int d, int N, int b, long long cells, const int *node, const double *area,
                    const double *volume, const double *slopes, const double *u, double *strain)
{
  for (long long n = 0; n < cells; ++n)
    for (int c = 0; c < b; ++c) {
      double slope[4][3] = {{0}}, gradient[3][3] = {{0}};
      for (int j = 0; j <= d; ++j)
        for (int v = 0; v < N; ++v) {
          const double factor = slopes[(c * (d + 1) + j) * N + v];
          for (int i = 0; i < d && factor != 0.0; ++i)
            slope[j][i] += factor * u[(long long)node[n * N + v] * d + i];
        }
      const double share = -1 / (d * volume[n]); /* of an area that is the gradient of a barycentric coordinate */
      for (int j = 1; j <= d; ++j)
        for (int i = 0; i < d; ++i)
          for (int e = 0; e < d; ++e)
            gradient[i][e] += (slope[j][i] - slope[0][i]) * (share * area[(n * (d + 1) + j) * d + e]);
      for (int i = 0; i < d; ++i)
        *strain++ = gradient[i][i];
      for (int i = 0; i < d; ++i)
        for (int e = i + 1; e < d; ++e)
          *strain++ = (gradient[i][e] + gradient[e][i]) * M_SQRT1_2;
    }
}

void cell_strains(int d, int N, int b, long long cells, const int *node, const double *area, const double *volume,
                  const double *slopes, const double *u, double *strain)
{
  if (d == 2)
    strains(2, N, b, cells, node, area, volume, slopes, u, strain);
  else
    strains(3, N, b, cells, node, area, volume, slopes, u, strain);
}

/* Tensors from Mandel components and back. */
static const int COLUMN[2][6] = {{0, 1, 1}, {0, 1, 2, 1, 2, 2}}, ROW[2][6] = {{0, 1, 0}, {0, 1, 2, 0, 0, 1}};

INLINE void macro(const int d, int N, int m, int b, long long cells, const double *edges, const double *stress,
                  const double *forces, const double *force, const double *map, const double *of_facets,
                  const double *of_subs, double *sigma)
{
  const int s = d * (d + 1) / 2, inputs = ((d + 1) * m + b) * d;
  for (long long first = 0; first < cells; first += LANES) {
    const int here = cells - first < LANES ? (int)(cells - first) : LANES;
    lanes x[3][3], inverse[3][3], base[4][9], given[84], reference[84], nodal[240], P[6][6];
    for (int l = 0; l < LANES; ++l) {
      const long long n = first + (l < here ? l : 0);
      for (int i = 0; i < d * d; ++i)
        x[i / d][i % d][l] = edges[n * d * d + i];
      for (int i = 0; i < b * d * d; ++i)
        base[i / (d * d)][i % (d * d)][l] = stress[n * b * d * d + i];
      for (int i = 0; i < (d + 1) * m * d; ++i)
        given[i][l] = forces[n * (d + 1) * m * d + i];
      for (int i = 0; i < b * d; ++i)
        given[(d + 1) * m * d + i][l] = force ? force[n * b * d + i] : 0.0;
    }
    const lanes determinant = inverted(d, x, inverse), volume = absolute(determinant) / (d == 2 ? 2.0 : 6.0);
    for (int f = 0; f <= d; ++f) {
      lanes area[3], push[4][3];
      for (int i = 0; i < d; ++i) {
        area[i] = f ? inverse[f - 1][i] : -inverse[0][i] - inverse[1][i] - (d == 3 ? inverse[2][i] : (lanes){0});
        area[i] *= -volume * (double)d;
      }
      for (int c = 0; c < b; ++c)
        for (int i = 0; i < d; ++i) {
          push[c][i] = dot(d, base[c] + i * d, area);
          for (int j = 0; j < m; ++j)
            given[(f * m + j) * d + i] -= of_facets[(f * m + j) * b + c] * push[c][i];
        }
      for (int c = 0; c < b && b > 1; ++c) /* the divergence of a linear stress: vertex f has the slope of facet f */
        for (int i = 0; i < d; ++i)
          given[((d + 1) * m + c) * d + i] -= push[f][i] / (double)d;
    }
    for (int i = 0; i < inputs; ++i)
      reference[i] = dot(d, inverse[i % d], given + i / d * d);
    memset(nodal, 0, sizeof(nodal));
    matrix_times((d + 1) * N * s, inputs, map, reference, nodal);
    images(d, x, P);
    for (int q = 0; q < (d + 1) * N; ++q)
      for (int a = 0; a < s; ++a) {
        lanes value = {0}, added = {0};
        for (int k = 0; k < s; ++k)
          value += nodal[q * s + k] * P[k][a];
        for (int c = 0; c < b; ++c)
          added += of_subs[q * b + c] * base[c][ROW[d - 2][a] * d + COLUMN[d - 2][a]];
        value = value / absolute(determinant) + (a < d ? 1.0 : M_SQRT2) * added;
        for (int l = 0; l < here; ++l)
          sigma[((first + l) * (d + 1) * N + q) * s + a] = value[l];
      }
  }
}

void macro_stresses(int d, int N, int m, int b, long long cells, const double *edges, const double *stress,
                    const double *forces, const double *force, const double *map, const double *of_facets,
                    const double *of_subs, double *sigma)
{
  if (d == 2)
    macro(2, N, m, b, cells, edges, stress, forces, force, map, of_facets, of_subs, sigma);
  else
    macro(3, N, m, b, cells, edges, stress, forces, force, map, of_facets, of_subs, sigma);
}
