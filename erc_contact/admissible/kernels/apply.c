/* Products with the inverses of the small problems of complementary energy on patches, see tighten/patches.py. */
#include "kernels.h"
#include "rings.h"

/* Solve with such a factor, in place. */
INLINE void solve(int N, const int *factor, const float *unit, lanes *y, lanes *inverse)
{
  const digits *row = (const digits *)factor;
  const units *of_row = (const units *)unit;
  for (int i = 0; i < N; row += ++i) {
    /* Two sums at once hide how long each of them takes. */
    lanes sum = {0}, odd = {0};
    int j = 0;
    for (; j + 1 < i; j += 2) {
      sum += WIDE(row[j]) * y[j];
      odd += WIDE(row[j + 1]) * y[j + 1];
    }
    if (j < i)
      sum += WIDE(row[j]) * y[j];
    sum += odd;
    const lanes step = WIDE(of_row[i]), diagonal = WIDE(row[i]) * step;
    for (int l = 0; l < LANES; ++l)
      inverse[i][l] = diagonal[l] > 0 ? 1 / diagonal[l] : 0.0;
    y[i] = (y[i] - sum * step) * inverse[i];
  }
  for (int i = N - 1; i >= 0; --i) {
    row -= i + 1;
    y[i] *= inverse[i];
    const lanes share = y[i] * WIDE(of_row[i]);
    for (int j = 0; j < i; ++j)
      y[j] -= WIDE(row[j]) * share;
  }
}

/* What acts on the facets of some rings, and the work of a residual r on each unknown. */
INLINE void gather_works(const int d, int moments, int count, int m, const int *ring, const double *edges,
                         const long long *side, const double *r, actions *on, lanes *y)
{
  const int w = (d - 1) * d + 1, b = d * (d - 1) / 2;
  lanes length = {0};
  memset(y, 0, w * sizeof(lanes));
  for (int i = 0; i < m; ++i) {
    lanes x[3][3], sense, values[3][3];
    for (int l = 0; l < LANES; ++l) {
      const int code = ring[(l < count ? l : 0) * m + i], facet = code / 2 / d;
      const long long place = side[facet], cell = place / (d + 1);
      const double *from = r + (size_t)facet * moments * d;
      int node[4];
      in_order(d, place % (d + 1), code / 2 % d, node);
      gather_edges(d, d - 1, edges + cell * d * d, node, l, x);
      sense[l] = code % 2 ? 1.0 : -1.0;
      in_order(d, d, code / 2 % d, node);
      for (int v = 0; v < d; ++v)
        for (int c = 0; c < d; ++c)
          values[v][c][l] = from[node[v] * d + c];
    }
    if (i == 0)
      length = root(dot(d, x[0], x[0]));
    on[i] = acting(d, x[0], x[d - 2], sense, length);
    for (int h = 0; h < w - 1; ++h)
      y[h] += sense * values[h / d][h % d];
    for (int v = 0; v < d; ++v)
      y[w - 1] += on[i].weight[v] * dot(d, on[i].normal, values[v]);
    for (int t = 0; t < b; ++t)
      y[w + b * i + t] = dot(d, on[i].bar[t], values[ENDS[t][1]]) - dot(d, on[i].bar[t], values[ENDS[t][0]]);
  }
}

/* Add the moments of the unknowns of some rings to z. */
INLINE void scatter_moments(const int d, int moments, int count, int m, const int *ring, const actions *on,
                            const lanes *y, double *z)
{
  const int w = (d - 1) * d + 1, b = d * (d - 1) / 2;
  for (int i = 0; i < m; ++i) {
    lanes values[3][3];
    for (int v = 0; v < d; ++v)
      for (int c = 0; c < d; ++c) {
        values[v][c] = on[i].weight[v] * on[i].normal[c] * y[w - 1];
        if (v < d - 1)
          values[v][c] += on[i].sense * y[v * d + c];
      }
    for (int t = 0; t < b; ++t)
      for (int c = 0; c < d; ++c) {
        values[ENDS[t][0]][c] -= on[i].bar[t][c] * y[w + b * i + t];
        values[ENDS[t][1]][c] += on[i].bar[t][c] * y[w + b * i + t];
      }
    for (int l = 0; l < count; ++l) {
      const int code = ring[l * m + i];
      double *to = z + (size_t)(code / 2 / d) * moments * d;
      int node[4];
      in_order(d, d, code / 2 % d, node);
      for (int v = 0; v < d; ++v)
        for (int c = 0; c < d; ++c)
          to[node[v] * d + c] += values[v][c][l];
    }
  }
}

INLINE int applied(const int d, int moments, long long patches, const int *ring, const int *size,
                   const double *edges, const long long *side, const int *factor, const float *unit,
                   const double *scale, const double *r, double *z)
{
  const int w = (d - 1) * d + 1, b = d * (d - 1) / 2, largest = patches ? size[patches - 1] : 1;
  lanes *y = aligned_alloc(sizeof(lanes), 2 * (w + b * (size_t)largest) * sizeof(lanes));
  actions *on = aligned_alloc(sizeof(lanes), largest * sizeof(actions));
  if (!y || !on) {
    free(y);
    free(on);
    return -1;
  }
  for (long long p = 0; p < patches;) {
    const int m = size[p], count = alike(patches - p, size + p), N = w + b * m;
    gather_works(d, moments, count, m, ring, edges, side, r, on, y);
    solve(N, factor, unit, y, y + N);
    factor += (size_t)N * (N + 1) / 2 * LANES;
    unit += N * LANES;
    for (int l = 0; l < LANES; ++l, ++scale)
      for (int i = 0; i < N; ++i)
        y[i][l] *= *scale;
    scatter_moments(d, moments, count, m, ring, on, y, z);
    ring += count * m;
    p += count;
  }
  free(y);
  free(on);
  return 0;
}

int apply_patches(int m, long long patches, const int *ring, const int *size, const double *edges,
                  const long long *side, const int *factor, const float *unit, const double *scale, const double *r,
                  double *z)
{
  return applied(DIMENSION, m, patches, ring, size, edges, side, factor, unit, scale, r, z);
}
