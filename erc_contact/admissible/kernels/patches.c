/* Rings of facets, and the small problems of complementary energy on them, see tighten/patches.py.

   A step of a ring is a number 2 p + q. The pair p = d * facet + j is the facet in the ring of the centre that is
   opposite to its node j; q = 1 if the first cell of the facet is the next one in the ring, 0 if the second one is. */
#include "kernels.h"
#include "lanes.h"

/* Local nodes of a cell in the order of a ring from its facet f, whose node j is not on the centre: the nodes of the
   centre, node j of the facet, and the node that is not on the facet. */
INLINE void in_order(const int d, int f, int j, int *node)
{
  const int apex = j < f ? j : j + 1;
  int at = 0;
  for (int v = 0; v <= d; ++v)
    if (v != f && v != apex)
      node[at++] = v;
  node[d - 1] = apex;
  node[d] = f;
}

/* Whether these nodes of a cell are oriented as the space is. */
INLINE int oriented(const int d, const double *edges, const int *node)
{
  int turns = 0;
  for (int a = 0; a < d; ++a)
    for (int b = a + 1; b <= d; ++b)
      turns += node[a] > node[b];
  const double *x = edges, *y = edges + d, *z = edges + 2 * d;
  const double determinant = d == 2 ? x[0] * y[1] - x[1] * y[0]
                                    : x[0] * (y[1] * z[2] - y[2] * z[1]) + x[1] * (y[2] * z[0] - y[0] * z[2])
                                          + x[2] * (y[0] * z[1] - y[1] * z[0]);
  return (determinant > 0) == (turns % 2 == 0);
}

/* The pair of the next facet of a ring (on = 1) or of the one before (on = 0), -1 at the end. */
INLINE long long neighbour(const int d, long long pairs, const double *edges, const int *facets,
                           const long long *side, long long pair, int on, int *code)
{
  const long long facet = pair / d, F = pairs / d;
  int node[4];
  long long place = side[facet];
  in_order(d, place % (d + 1), pair % d, node);
  const int first = oriented(d, edges + place / (d + 1) * d * d, node);
  *code = 2 * (int)pair + first;
  if (first != on) {
    if (side[F + facet] == place)
      return -1;
    place = side[F + facet];
    in_order(d, place % (d + 1), pair % d, node);
  }
  const int f = node[d], apex = node[d - 1];
  return (long long)facets[place / (d + 1) * (d + 1) + apex] * d + (f < apex ? f : f - 1);
}

INLINE long long rings(const int d, long long pairs, const double *edges, const int *facets, const long long *side,
                       _Bool *mine, int *ring, int *size)
{
  long long found = 0;
  int code;
  for (long long pair = 0; pair < pairs; ++pair) {
    if (!mine[pair])
      continue;
    long long begin = pair, next;
    while ((next = neighbour(d, pairs, edges, facets, side, begin, 0, &code)) >= 0 && next != pair)
      begin = next;
    size[found] = 0;
    next = begin;
    do {
      const long long here = next;
      mine[here] = 0;
      next = neighbour(d, pairs, edges, facets, side, here, 1, &code);
      *ring++ = code;
      ++size[found];
    } while (next >= 0 && next != begin);
    ++found;
  }
  return found;
}

/* What acts on a facet of a ring: the couple, normal times weight of each node, and bars along its edges. All unknowns
   are forces: the couple is a moment over a length, and the bars are edges over it. */
typedef struct {
  lanes normal[3], weight[3], bar[3][3], sense;
} actions;

static const int ENDS[3][2] = {{0, 1}, {0, 2}, {1, 2}};

/* Edges from the first node of the centre: to its second node (in 3D), and to the node that is not on it. */
INLINE actions acting(const int d, const lanes *base, const lanes *apex, lanes sense, lanes length)
{
  actions it = {.sense = sense};
  lanes height[3], size, share = {0};
  memcpy(height, apex, d * sizeof(lanes));
  if (d == 3) {
    share = dot(3, apex, base) / dot(3, base, base);
    for (int i = 0; i < 3; ++i)
      height[i] -= share * base[i];
  }
  size = root(dot(d, height, height));
  across(d, d == 2 ? height : base, height, it.normal);
  const lanes turn = -sense / root(dot(d, it.normal, it.normal));
  for (int i = 0; i < d; ++i)
    it.normal[i] *= turn;
  it.weight[d - 1] = length / size;
  it.weight[0] = (share - 1.0) * it.weight[d - 1];
  if (d == 3)
    it.weight[1] = -share * it.weight[2];
  const lanes none[3] = {{0}}, *nodes[3] = {none, d == 3 ? base : apex, apex};
  for (int t = 0; t < d * (d - 1) / 2; ++t)
    for (int i = 0; i < d; ++i)
      it.bar[t][i] = (nodes[ENDS[t][1]][i] - nodes[ENDS[t][0]][i]) / length;
  return it;
}

/* Edges of a cell from its node[0] to the next nodes. */
INLINE void gather_edges(const int d, int count, const double *edges, const int *node, int lane, lanes (*x)[3])
{
  static const double zero[3] = {0, 0, 0};
  const double *from = node[0] ? edges + d * (node[0] - 1) : zero;
  for (int v = 1; v <= count; ++v)
    for (int i = 0; i < d; ++i)
      x[v - 1][i][lane] = (node[v] ? edges[d * (node[v] - 1) + i] : 0.0) - from[i];
}

/* How many patches from this one on have rings of its size, at most LANES. */
INLINE int alike(long long left, const int *size)
{
  int count = 1;
  while (count < LANES && count < left && size[count] == size[0])
    ++count;
  return count;
}

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

/* Which unknowns of the patches may act: they change no given component of a traction. In 3D all bars along the centre
   of one ring together do the same as forces at its two ends, so the first of these bars is left out. */
INLINE void allowed(const int d, const int *ring, int m, int lane, const actions *on, const _Bool *unknown, lanes *keep)
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
      lanes sum = row[j];
      for (int k = 0; k < j; ++k)
        sum -= row[k] * other[k];
      row[j] = j < i ? sum * other[j] : sum;
    }
    for (int l = 0; l < LANES; ++l)
      row[i][l] = keep[i][l] > 0 && row[i][l] > 1e-14 * whole[l] ? 1 / sqrt(row[i][l]) : 0.0;
  }
}

/* The matrices of some patches with rings of m facets, and which of their unknowns may act. */
INLINE void assemble(const int d, int count, int m, const int *ring, const double *edges, const int *facets,
                     const long long *side, long long F, const _Bool *unknown, const double *compliance, int varies,
                     const double *table, lanes *keep, lanes *A, actions *on)
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
    allowed(d, ring + (l < count ? l : 0) * m, m, l, on, unknown, keep);
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
        largest[l] = fmax(largest[l], fabs(A[j][l]));
    for (int l = 0; l < LANES; ++l) {
      unit[l] = largest[l] > 0 ? (float)(largest[l] * 0x1p-30) : 1.0f;
      share[l] = 1 / (double)unit[l];
    }
    for (int j = 0; j <= i; ++j)
      *(digits *)(factor + j * LANES) = __builtin_convertvector((A[j] * share + 0x1.8p52) - 0x1.8p52, digits);
  }
}

/* Solve with such a factor, in place. */
INLINE void solve(int N, const int *factor, const float *unit, lanes *y, lanes *inverse)
{
  const digits *row = (const digits *)factor;
  const units *of_row = (const units *)unit;
  for (int i = 0; i < N; row += ++i) {
    lanes sum = {0};
    for (int j = 0; j < i; ++j)
      sum += WIDE(row[j]) * y[j];
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

INLINE int factored(const int d, long long patches, const int *ring, const int *size, const double *edges,
                    const int *facets, const long long *side, long long F, const _Bool *unknown,
                    const double *compliance, int varies, const double *table, int *factor, float *unit, double *scale)
{
  const int w = (d - 1) * d + 1, b = d * (d - 1) / 2, largest = patches ? size[patches - 1] : 0;
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
    assemble(d, count, m, ring, edges, facets, side, F, unknown, compliance, varies, table, keep, A, on);
    lanes whole = {0};
    for (int i = 0; i < N; ++i)
      for (int l = 0; l < LANES; ++l)
        whole[l] = fmax(whole[l], A[i * (i + 1) / 2 + i][l]);
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

INLINE int applied(const int d, int m_moments, long long patches, const int *ring, const int *size,
                   const double *edges, const long long *side, const int *factor, const float *unit, const double *scale,
                   const double *r, double *z)
{
  const int w = (d - 1) * d + 1, b = d * (d - 1) / 2, largest = patches ? size[patches - 1] : 0;
  lanes *y = aligned_alloc(sizeof(lanes), 2 * (w + b * (size_t)largest) * sizeof(lanes));
  actions *on = aligned_alloc(sizeof(lanes), largest * sizeof(actions));
  if (!y || !on) {
    free(y);
    free(on);
    return -1;
  }
  for (long long p = 0; p < patches;) {
    const int m = size[p], count = alike(patches - p, size + p), N = w + b * m;
    lanes length = {0};
    memset(y, 0, w * sizeof(lanes));
    for (int i = 0; i < m; ++i) {
      lanes x[3][3], sense, values[3][3];
      for (int l = 0; l < LANES; ++l) {
        const int code = ring[(l < count ? l : 0) * m + i], facet = code / 2 / d;
        const long long place = side[facet], cell = place / (d + 1);
        const double *from = r + (size_t)facet * m_moments * d;
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
    solve(N, factor, unit, y, y + N);
    factor += (size_t)N * (N + 1) / 2 * LANES;
    unit += N * LANES;
    for (int l = 0; l < LANES; ++l, ++scale)
      for (int i = 0; i < N; ++i)
        y[i][l] *= *scale;
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
        double *to = z + (size_t)(code / 2 / d) * m_moments * d;
        int node[4];
        in_order(d, d, code / 2 % d, node);
        for (int v = 0; v < d; ++v)
          for (int c = 0; c < d; ++c)
            to[node[v] * d + c] += values[v][c][l];
      }
    }
    ring += count * m;
    p += count;
  }
  free(y);
  free(on);
  return 0;
}

long long find_rings(int d, long long pairs, const double *edges, const int *facets, const long long *side,
                     _Bool *mine, int *ring, int *size)
{
  return d == 2 ? rings(2, pairs, edges, facets, side, mine, ring, size)
                : rings(3, pairs, edges, facets, side, mine, ring, size);
}

int factor_patches(int d, long long patches, const int *ring, const int *size, const double *edges,
                   const int *facets, const long long *side, long long F, const _Bool *unknown, const double *compliance,
                   int varies, const double *table, int *factor, float *unit, double *scale)
{
  return d == 2 ? factored(2, patches, ring, size, edges, facets, side, F, unknown, compliance, varies, table, factor, unit, scale)
                : factored(3, patches, ring, size, edges, facets, side, F, unknown, compliance, varies, table, factor, unit, scale);
}

int apply_patches(int d, int m, long long patches, const int *ring, const int *size, const double *edges,
                  const long long *side, const int *factor, const float *unit, const double *scale, const double *r, double *z)
{
  return d == 2 ? applied(2, m, patches, ring, size, edges, side, factor, unit, scale, r, z)
                : applied(3, m, patches, ring, size, edges, side, factor, unit, scale, r, z);
}
