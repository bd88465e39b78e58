/* Cholesky factors of the small problems of complementary energy on patches, see tighten/patches.py. */
#include "kernels.h"
#include "rings.h"

/* Whether a vector has no component that is given. */
INLINE int may_act(const int d, const lanes *vector, int lane, const _Bool *unknown)
{
  double size = 0.0;
  for (int i = 0; i < d; ++i)
    size += vector[i][lane] * vector[i][lane];
  for (int i = 0; i < d; ++i)
    if (!unknown[i] && fabs(vector[i][lane]) > 1e-12 * sqrt(size))
      return 0;
  return 1;
}

/* Which unknowns of the patches may act: they change no given component of a traction, and no couple leaves a rigid
   face that turns freely, as its moment is given. In 3D all bars along the centre of one ring together do the same as
   forces at its two ends, so the first of these bars is left out. */
INLINE void allowed(const int d, const int *ring, int m, int lane, const actions *on, const _Bool *unknown,
                    const int *turning, lanes *keep)
{
  const int w = (d - 1) * d + 1, b = d * (d - 1) / 2;
  _Bool force[3] = {1, 1, 1};
  for (int i = 0; i < m; ++i) {
    const _Bool *here = unknown + ring[i] / (2 * d) * d;
    for (int c = 0; c < d; ++c)
      force[c] &= here[c];
    keep[w - 1][lane] *= may_act(d, on[i].normal, lane, here);
    for (int t = 0; t < b; ++t)
      keep[w + b * i + t][lane] = may_act(d, on[i].bar[t], lane, here);
  }
  for (int c = 0; c < w - 1; ++c)
    keep[c][lane] = force[c % d];
  if (d == 3 && may_act(3, on[0].bar[0], lane, force))
    keep[w][lane] = 0.0;
  if (turning && turning[ring[0] / (2 * d)] != turning[ring[m - 1] / (2 * d)])
    keep[w - 1][lane] = 0.0;
}

/* The energies of a cell of each ring for what acts on its facets f and g: forces, couple, bars of f, bars of g. */
INLINE void cell_energies(const int d, lanes (*x)[3], const lanes *compliance, const double *table,
                          lanes sign_f, lanes sign_g, lanes present, lanes length, lanes *local)
{
  const int w = (d - 1) * d + 1, b = d * (d - 1) / 2, s = d * (d + 1) / 2, raw = 2 * d * d, all = w + 2 * b;
  lanes inverse[3][3], metric[21], energy[18][18], column[13][6][3], product[13][18];
  const lanes determinant = inverted(d, x, inverse);
  reference_metric(d, x, determinant, compliance, metric);
  memset(product, 0, sizeof(product));
  matrix_times(raw * (raw + 1) / 2, s * (s + 1) / 2, table, metric, product[0]);
  const lanes *entry = product[0];
  for (int p = 0; p < raw; ++p)
    for (int q = 0; q <= p; ++q)
      energy[p][q] = energy[q][p] = *entry++ * present;
  const actions on[2] = {acting(d, x[0], x[d - 2], ONE, length), acting(d, x[0], x[d - 1], -ONE, length)};
  int slots[13][6], count[13];
  for (int h = 0; h < w - 1; ++h) {
    count[h] = 2;
    for (int side = 0; side < 2; ++side) {
      slots[h][side] = side * d + h / d;
      for (int i = 0; i < d; ++i)
        column[h][side][i] = side ? -inverse[i][h % d] : inverse[i][h % d];
    }
  }
  count[w - 1] = 2 * d;
  for (int side = 0; side < 2; ++side)
    for (int v = 0; v < d; ++v) {
      slots[w - 1][side * d + v] = side * d + v;
      for (int i = 0; i < d; ++i)
        column[w - 1][side * d + v][i] = on[side].weight[v] * dot(d, inverse[i], on[side].normal);
    }
  for (int side = 0; side < 2; ++side)
    for (int t = 0; t < b; ++t) {
      const int c = w + side * b + t;
      count[c] = 2;
      for (int i = 0; i < d; ++i) {
        const lanes along = (side ? sign_g : sign_f) * dot(d, inverse[i], on[side].bar[t]);
        column[c][0][i] = -along;
        column[c][1][i] = along;
      }
      for (int end = 0; end < 2; ++end)
        slots[c][end] = side * d + ENDS[t][end];
    }
  for (int c = 0; c < all; ++c) {
    for (int p = 0; p < raw; ++p) {
      lanes sum = {0};
      for (int k = 0; k < count[c]; ++k)
        sum += dot(d, energy[p] + slots[c][k] * d, column[c][k]);
      product[c][p] = sum;
    }
    for (int other = 0; other <= c; ++other) {
      lanes sum = {0};
      for (int k = 0; k < count[other]; ++k)
        sum += dot(d, product[c] + slots[other][k] * d, column[other][k]);
      *local++ = sum;
    }
  }
}

/* Cholesky factor of (N, N) symmetric matrices in place, row by row, with the inverses of its diagonal. What may not
   act, or has no energy of its own, gets 0 there. */
INLINE void factorise(int N, const lanes *keep, lanes *A)
{
  for (int i = 0; i < N; ++i) {
    lanes *row = A + i * (i + 1) / 2;
    const lanes whole = row[i];
    for (int j = 0; j <= i; ++j) {
      const lanes *other = A + j * (j + 1) / 2;
      const lanes sum = row[j] - product(j, row, other);
      row[j] = j < i ? sum * other[j] : sum;
    }
    for (int l = 0; l < LANES; ++l)
      row[i][l] = keep[i][l] > 0 && row[i][l] > 1e-14 * whole[l] ? 1 / sqrt(row[i][l]) : 0.0;
  }
}

/* The matrices of some patches with rings of m facets, and which of their unknowns may act. */
INLINE void assemble(const int d, int count, int m, const int *ring, const double *edges, const int *facets,
                     const long long *side, long long F, const _Bool *unknown, const int *turning,
                     const double *compliance, int varies, const double *table, lanes *keep, lanes *A, actions *on)
{
  const int w = (d - 1) * d + 1, b = d * (d - 1) / 2, s = d * (d + 1) / 2, all = w + 2 * b;
  lanes length = {0}, C[36];
  for (int k = 0; k < s * s; ++k)
    C[k] = compliance[k] * ONE;
  for (int i = 0; i < m; ++i) {
    lanes x[3][3], local[91], sign_f, sign_g, present;
    for (int l = 0; l < LANES; ++l) {
      const int code = ring[(l < count ? l : 0) * m + i], facet = code / 2 / d;
      const int beyond = code % 2 == 0, missing = beyond && side[F + facet] == side[facet];
      const long long place = side[beyond && !missing ? F + facet : facet], cell = place / (d + 1);
      int node[4];
      in_order(d, place % (d + 1), code / 2 % d, node);
      gather_edges(d, d, edges + cell * d * d, node, l, x);
      const long long next = cell * (d + 1) + node[d - 1];
      sign_f[l] = beyond ? -1.0 : 1.0;
      sign_g[l] = side[facets[next]] == next ? 1.0 : -1.0;
      present[l] = !missing;
      for (int k = 0; k < s * s && varies; ++k)
        C[k][l] = compliance[cell * s * s + k];
    }
    if (i == 0)
      length = root(dot(d, x[0], x[0]));
    on[i] = acting(d, x[0], x[d - 2], ONE, length);
    cell_energies(d, x, C, table, sign_f, sign_g, present, length, local);
    int at[13];
    for (int c = 0; c < all; ++c)
      at[c] = c < w ? c : c < w + b ? b * i + c : b * ((i + 1) % m) + c - b;
    const lanes *entry = local;
    for (int p = 0; p < all; ++p)
      for (int q = 0; q <= p; ++q) {
        const int high = at[p] > at[q] ? at[p] : at[q], low = at[p] > at[q] ? at[q] : at[p];
        A[high * (high + 1) / 2 + low] += *entry++;
      }
  }
  for (int l = 0; l < LANES; ++l)
    allowed(d, ring + (l < count ? l : 0) * m, m, l, on, unknown, turning, keep);
}

/* Write a factor with 31 binary digits for each entry, counted from the largest one of its row. The sum with 1.5 * 2^52
   has no digits after the point. */
INLINE void shorten(int N, lanes *A, int *factor, float *unit)
{
  for (int i = 0; i < N; ++i, A += i, factor += i * LANES, unit += LANES) {
    lanes largest = {0}, share;
    for (int l = 0; l < LANES; ++l)
      A[i][l] = A[i][l] > 0 ? 1 / A[i][l] : 0.0;
    for (int j = 0; j <= i; ++j)
      for (int l = 0; l < LANES; ++l)
        largest[l] = fabs(A[j][l]) > largest[l] ? fabs(A[j][l]) : largest[l];
    for (int l = 0; l < LANES; ++l) {
      unit[l] = largest[l] > 0 ? (float)(largest[l] * 0x1p-30) : 1.0f;
      share[l] = 1 / (double)unit[l];
    }
    for (int j = 0; j <= i; ++j)
      *(digits *)(factor + j * LANES) = __builtin_convertvector((A[j] * share + 0x1.8p52) - 0x1.8p52, digits);
  }
}

INLINE int factored(const int d, long long patches, const int *ring, const int *size, const double *edges,
                    const int *facets, const long long *side, long long F, const _Bool *unknown, const int *turning,
                    const double *compliance, int varies, const double *table, int *factor, float *unit, double *scale)
{
  const int w = (d - 1) * d + 1, b = d * (d - 1) / 2, largest = patches ? size[patches - 1] : 1;
  const size_t most = w + b * largest, entries = most * (most + 1) / 2;
  lanes *keep = aligned_alloc(sizeof(lanes), (most + entries) * sizeof(lanes)), *A = keep + most;
  actions *on = aligned_alloc(sizeof(lanes), largest * sizeof(actions));
  if (!keep || !on) {
    free(keep);
    free(on);
    return -1;
  }
  for (long long p = 0; p < patches;) {
    const int m = size[p], count = alike(patches - p, size + p), N = w + b * m;
    for (int i = 0; i < N; ++i)
      keep[i] = ONE;
    memset(A, 0, N * (N + 1) / 2 * sizeof(lanes));
    assemble(d, count, m, ring, edges, facets, side, F, unknown, turning, compliance, varies, table, keep, A, on);
    lanes whole = {0};
    for (int i = 0; i < N; ++i)
      for (int l = 0; l < LANES; ++l)
        whole[l] = A[i * (i + 1) / 2 + i][l] > whole[l] ? A[i * (i + 1) / 2 + i][l] : whole[l];
    for (int i = 0; i < N * (N + 1) / 2; ++i)
      A[i] /= whole;
    factorise(N, keep, A);
    shorten(N, A, factor, unit);
    factor += (size_t)N * (N + 1) / 2 * LANES;
    unit += N * LANES;
    for (int l = 0; l < LANES; ++l)
      *scale++ = 1 / whole[l];
    ring += count * m;
    p += count;
  }
  free(keep);
  free(on);
  return 0;
}

int factor_patches(long long patches, const int *ring, const int *size, const double *edges,
                   const int *facets, const long long *side, long long F, const _Bool *unknown, const int *turning,
                   const double *compliance, int varies, const double *table, int *factor, float *unit, double *scale)
{
  return factored(DIMENSION, patches, ring, size, edges, facets, side, F, unknown, turning, compliance, varies, table,
                  factor, unit, scale);
}
