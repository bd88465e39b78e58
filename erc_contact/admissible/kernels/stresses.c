/* Strains and stresses of cells, and their energies, see admissible/elastic.py, macro.py and error/bulk.py. */
#include "kernels.h"
#include "lanes.h"

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

void cell_strains(int N, int b, long long cells, const int *node, const double *area, const double *volume,
                  const double *slopes, const double *u, double *strain)
{
  strains(DIMENSION, N, b, cells, node, area, volume, slopes, u, strain);
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

void macro_stresses(int N, int m, int b, long long cells, const double *edges, const double *stress,
                    const double *forces, const double *force, const double *map, const double *of_facets,
                    const double *of_subs, double *sigma)
{
  macro(DIMENSION, N, m, b, cells, edges, stress, forces, force, map, of_facets, of_subs, sigma);
}

/* The traction of a stress in Mandel components on an area. */
INLINE void traction(const int d, const lanes *stress, const lanes *area, lanes *push)
{
  for (int i = 0; i < d; ++i)
    push[i] = stress[i] * area[i];
  for (int a = d; a < d * (d + 1) / 2; ++a) {
    const int i = ROW[d - 2][a], j = COLUMN[d - 2][a];
    push[i] += M_SQRT1_2 * stress[a] * area[j];
    push[j] += M_SQRT1_2 * stress[a] * area[i];
  }
}

INLINE lanes larger(lanes a, lanes b)
{
  for (int l = 0; l < LANES; ++l)
    a[l] = a[l] != a[l] || b[l] <= a[l] ? a[l] : b[l]; /* what is no number stays */
  return a;
}

/* Greatest product of a stress and its area in a cell, and greatest force that is missing in its equilibrium. */
INLINE void unbalanced(const int d, int N, int m, int b, long long cells, const double *area, const double *stress,
                       const double *forces, const double *force, const int *between, const int *on_facet,
                       const int *common, double *missing, double *size)
{
  const int s = d * (d + 1) / 2;
  for (long long first = 0; first < cells; first += LANES) {
    const int here = cells - first < LANES ? (int)(cells - first) : LANES;
    lanes A[4][3], C[240], given[72], body[12], worst = {0}, most = {0}, longest = {0};
    for (int l = 0; l < LANES; ++l) {
      const long long n = first + (l < here ? l : 0);
      for (int i = 0; i < (d + 1) * d; ++i)
        A[i / d][i % d][l] = area[n * (d + 1) * d + i];
      for (int i = 0; i < (d + 1) * N * s; ++i)
        C[i][l] = stress[n * (d + 1) * N * s + i];
      for (int i = 0; i < (d + 1) * m * d; ++i)
        given[i][l] = forces[n * (d + 1) * m * d + i];
      for (int i = 0; i < b * d; ++i)
        body[i][l] = force ? force[n * b * d + i] : 0.0;
    }
    for (int i = 0; i <= d; ++i) {
      longest = larger(longest, dot(d, A[i], A[i]));
      for (int v = 0; v < N; ++v)
        most = larger(most, dot(s, C + (i * N + v) * s, C + (i * N + v) * s));
      /* the facet of the cell */
      for (int j = 0; j < m; ++j) {
        lanes push[3];
        traction(d, C + (i * N + on_facet[i * m + j]) * s, A[i], push);
        for (int e = 0; e < d; ++e)
          push[e] -= given[(i * m + j) * d + e];
        worst = larger(worst, dot(d, push, push));
      }
      /* the facets between this sub-simplex and those that follow */
      for (int k = i + 1; k <= d; ++k) {
        lanes across[3], jump[6], push[3];
        for (int e = 0; e < d; ++e)
          across[e] = A[k][e] - A[i][e];
        for (int j = 0; j < m; ++j) {
          const lanes *one = C + (i * N + common[(i * (d + 1) + k) * m + j]) * s;
          const lanes *two = C + (k * N + common[(k * (d + 1) + i) * m + j]) * s;
          for (int a = 0; a < s; ++a)
            jump[a] = one[a] - two[a];
          traction(d, jump, across, push);
          worst = larger(worst, dot(d, push, push));
        }
      }
      /* the body force: the barycentre of the cell stands in the place of vertex i */
      for (int c = 0; c < b; ++c) {
        lanes sum[3] = {{0}}, push[3], across[3];
        for (int v = 0; v <= d; ++v) {
          for (int e = 0; e < d; ++e)
            across[e] = v == i ? (double)(d + 1) * A[i][e] : A[v][e] - A[i][e];
          traction(d, C + (i * N + between[c * (d + 1) + v]) * s, across, push);
          for (int e = 0; e < d; ++e)
            sum[e] -= push[e] * ((b == 1 ? 1.0 : 2.0) / d);
        }
        for (int e = 0; e < d; ++e) {
          lanes there = body[c * d + e];
          if (b > 1 && c == i) {
            there = body[e];
            for (int v = 1; v <= d; ++v)
              there += body[v * d + e];
            there /= (double)(d + 1);
          }
          sum[e] += there;
        }
        worst = larger(worst, dot(d, sum, sum));
      }
    }
    for (int l = 0; l < here; ++l) {
      missing[first + l] = sqrt(worst[l]);
      size[first + l] = sqrt(most[l] * longest[l]);
    }
  }
}

void unbalanced_stresses(int N, int m, int b, long long cells, const double *area, const double *stress,
                         const double *forces, const double *force, const int *between, const int *on_facet,
                         const int *common, double *missing, double *size)
{
  unbalanced(DIMENSION, N, m, b, cells, area, stress, forces, force, between, on_facet, common, missing, size);
}

INLINE void squared(const int s, long long cells, int subs, int N, int q, const double *shape, const double *weight,
                    const double *volume, const double *stress, int b, const double *of_elastic, const double *elastic,
                    int varies, int points, const double *compliance, double *difference, double *both)
{
  for (long long n = 0; n < cells; ++n) {
    double square[2] = {0};
    for (int at = 0; at < subs * q; ++at) {
      const double *C = compliance + ((varies ? n * points : 0) + (points > 1 ? at : 0)) * s * s;
      double tau[2][6], dual[2][6] = {{0}}, value[6] = {0}, given[6] = {0};
      if (b == subs * q)
        memcpy(given, elastic + (n * b + at) * s, s * sizeof(double));
      else
        for (int c = 0; c < b; ++c)
          for (int a = 0; a < s; ++a)
            given[a] += of_elastic[at * b + c] * elastic[(n * b + c) * s + a];
      for (int v = 0; v < N; ++v)
        for (int a = 0; a < s; ++a)
          value[a] += shape[at % q * N + v] * stress[((n * subs + at / q) * N + v) * s + a];
      for (int a = 0; a < s; ++a) {
        tau[0][a] = value[a] - given[a];
        tau[1][a] = value[a] + given[a];
      }
      for (int k = 0; k < 2; ++k) {
        for (int a = 0; a < s; ++a)
          for (int b = 0; b < s; ++b)
            dual[k][b] += tau[k][a] * C[a * s + b];
        for (int b = 0; b < s; ++b)
          square[k] += weight[at] * tau[k][b] * dual[k][b];
      }
    }
    difference[n] = volume[n] * square[0];
    both[n] = volume[n] * square[1];
  }
}

void stress_squares(long long cells, int subs, int N, int q, const double *shape, const double *weight,
                    const double *volume, const double *stress, int b, const double *of_elastic,
                    const double *elastic, int varies, int points, const double *compliance, double *difference,
                    double *both)
{
  const int s = DIMENSION * (DIMENSION + 1) / 2;
  squared(s, cells, subs, N, q, shape, weight, volume, stress, b, of_elastic, elastic, varies, points, compliance,
          difference, both);
}
