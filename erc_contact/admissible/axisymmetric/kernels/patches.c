/* Energies of facet forces of the half plane, and their small problems on patches, see axisymmetric/tighten.py.

   A step of a ring is 2 pair + q, as in tighten/rings.py, with pair / 2 the facet; q = 1 if its first cell follows. The
   unknowns of a patch are its flux, then 2 m - 1 amounts on each facet. */
#include "kernels.h"
#include "cell.h"

INLINE double product_with(const int x, long long owned, const int *facets, const long long *side, const double *matrix,
                           const double *slope, const double *forces, double *y)
{
  const int each = x / 3;
  double energy = 0.0;
  for (long long n = 0; n < owned; ++n) {
    double input[18], image[18] = {0};
    for (int f = 0; f < 3; ++f) {
      const double sign = side[facets[3 * n + f]] == 3 * n + f ? 1.0 : -1.0;
      for (int i = 0; i < each; ++i)
        input[f * each + i] = sign * forces[(long long)facets[3 * n + f] * each + i];
    }
    for (int j = 0; j < x; ++j)
      for (int i = 0; i < x; ++i)
        image[i] += matrix[(n * x + j) * x + i] * input[j];
    for (int i = 0; i < x; ++i) {
      energy += input[i] * image[i];
      if (slope) {
        energy += 2 * input[i] * slope[n * x + i];
        image[i] += slope[n * x + i];
      }
    }
    for (int f = 0; f < 3; ++f) {
      const double sign = side[facets[3 * n + f]] == 3 * n + f ? 1.0 : -1.0;
      for (int i = 0; i < each; ++i)
        y[(long long)facets[3 * n + f] * each + i] += sign * image[f * each + i];
    }
  }
  return energy;
}

double ring_energy(int k, long long owned, const int *facets, const long long *side, const double *matrix,
                   const double *slope, const double *x, double *y)
{
  return k == 1 ? product_with(12, owned, facets, side, matrix, slope, x, y)
                : product_with(18, owned, facets, side, matrix, slope, x, y);
}

/* Forces of a facet by the flux and its amounts, on the side of a cell, shape (2 m, 2 m). */
INLINE void acting(const int m, const double *along, const double *spread, double flux, double sign, double (*acts)[6])
{
  for (int i = 0; i < 2 * m; ++i) {
    acts[i][0] = i % 2 ? sign * flux * spread[i / 2] : 0.0;
    for (int j = 0; j < 2 * m - 1; ++j)
      acts[i][1 + j] = sign * along[i * (2 * m - 1) + j];
  }
}

/* Add to A, row by row of a lower triangle, the energies of a cell for what acts on its facets f and g. */
INLINE void add_block(const int m, const double *matrix, int f, int g, const double (*on_f)[6], const double (*on_g)[6],
                      int first_f, int first_g, double *A)
{
  const int x = 6 * m, size = 2 * m;
  double half[6][6] = {{0}};
  for (int i = 0; i < size; ++i)
    for (int j = 0; j < size; ++j)
      for (int c = 0; c < size; ++c)
        half[i][c] += matrix[(f * size + i) * x + g * size + j] * on_g[j][c];
  for (int c = 0; c < size; ++c) {
    const int row = c ? first_f + c - 1 : 0;
    for (int e = 0; e < size; ++e) {
      const int column = e ? first_g + e - 1 : 0;
      /* Of two blocks that are transposed the lower one counts; on the diagonal both do. */
      if (column > row)
        continue;
      double sum = 0.0;
      for (int i = 0; i < size; ++i)
        sum += on_f[i][c] * half[i][e];
      A[(size_t)row * (row + 1) / 2 + column] += sum;
    }
  }
}

/* The matrix of a patch. */
INLINE void assemble(const int m, int count, const int *ring, const int *facets, const long long *side, long long F,
                     const double *along, const double *spread, _Bool flows, const double *matrix, double *A)
{
  const int x = 6 * m, each = 2 * m - 1;
  for (int i = 0; i < count; ++i) {
    const int facet = ring[i] / 4, beyond = ring[i] % 2 == 0;
    if (beyond && side[F + facet] == side[facet])
      continue;
    const long long place = side[beyond ? F + facet : facet], cell = place / 3;
    const int next = (i + 1) % count, ends = next == i ? 1 : 2, number[2] = {i, next};
    double acts[2][6][6];
    int local[2], first[2];
    for (int e = 0; e < ends; ++e) {
      const int code = ring[number[e]], here = code / 4;
      const double sense = code % 2 ? 1.0 : -1.0;
      local[e] = facets[3 * cell] == here ? 0 : facets[3 * cell + 1] == here ? 1 : 2;
      const double sign = side[here] == 3 * cell + local[e] ? 1.0 : -1.0;
      first[e] = 1 + number[e] * each;
      acting(m, along + (size_t)here * 2 * m * each, spread + (size_t)here * m, flows ? sense : 0.0, sign, acts[e]);
    }
    for (int e = 0; e < ends; ++e)
      for (int g = 0; g < ends; ++g)
        add_block(m, matrix + (size_t)cell * x * x, local[e], local[g], (const double(*)[6])acts[e],
                  (const double(*)[6])acts[g], first[e], first[g], A);
  }
}

/* Cholesky factor in place, with the inverses of its diagonal: 0 for what has no energy of its own. */
INLINE void factorise(int size, double *A)
{
  for (int i = 0; i < size; ++i) {
    double *row = A + (size_t)i * (i + 1) / 2;
    const double whole = row[i];
    for (int j = 0; j <= i; ++j) {
      const double *other = A + (size_t)j * (j + 1) / 2;
      double sum[4] = {row[j], 0, 0, 0};
      int c = 0;
      /* Four sums at once hide how long each of them takes. */
      for (; c + 3 < j; c += 4)
        for (int l = 0; l < 4; ++l)
          sum[l] -= row[c + l] * other[c + l];
      for (; c < j; ++c)
        sum[0] -= row[c] * other[c];
      const double left = (sum[0] + sum[1]) + (sum[2] + sum[3]);
      row[j] = j < i ? left * other[j] : left;
    }
    row[i] = row[i] > 1e-14 * whole ? 1 / sqrt(row[i]) : 0.0;
  }
}

int ring_patches(int m, long long patches, const int *ring, const int *size, const int *facets,
                 const long long *side, long long F, const double *along, const double *spread,
                 const _Bool *flows, const double *matrix, double *factor)
{
  for (long long p = 0; p < patches; ++p) {
    const int unknowns = 1 + size[p] * (2 * m - 1);
    const size_t entries = (size_t)unknowns * (unknowns + 1) / 2;
    memset(factor, 0, entries * sizeof(double));
    if (m == 2)
      assemble(2, size[p], ring, facets, side, F, along, spread, flows[p], matrix, factor);
    else
      assemble(3, size[p], ring, facets, side, F, along, spread, flows[p], matrix, factor);
    factorise(unknowns, factor);
    factor += entries;
    ring += size[p];
  }
  return 0;
}

/* Solve with such a factor, in place. */
INLINE void solve(int size, const double *factor, double *y)
{
  for (int i = 0; i < size; ++i) {
    const double *row = factor + (size_t)i * (i + 1) / 2;
    double sum[4] = {y[i], 0, 0, 0};
    int j = 0;
    for (; j + 3 < i; j += 4)
      for (int l = 0; l < 4; ++l)
        sum[l] -= row[j + l] * y[j + l];
    for (; j < i; ++j)
      sum[0] -= row[j] * y[j];
    y[i] = ((sum[0] + sum[1]) + (sum[2] + sum[3])) * row[i];
  }
  for (int i = size - 1; i >= 0; --i) {
    const double *row = factor + (size_t)i * (i + 1) / 2;
    y[i] *= row[i];
    for (int j = 0; j < i; ++j)
      y[j] -= row[j] * y[i];
  }
}

INLINE void corrected(const int m, int count, const int *ring, const double *along, const double *spread, _Bool flows,
                      const double *factor, const double *r, double *z, double *y)
{
  const int each = 2 * m - 1;
  y[0] = 0.0;
  for (int i = 0; i < count; ++i) {
    const int facet = ring[i] / 4;
    const double *acts = along + (size_t)facet * 2 * m * each, *of_facet = r + (size_t)facet * 2 * m;
    double *to = y + 1 + i * each, flux = 0.0;
    for (int j = 0; j < m; ++j)
      flux += spread[(size_t)facet * m + j] * of_facet[2 * j + 1];
    if (flows)
      y[0] += ring[i] % 2 ? flux : -flux;
    for (int j = 0; j < each; ++j)
      to[j] = 0.0;
    for (int c = 0; c < 2 * m; ++c)
      for (int j = 0; j < each; ++j)
        to[j] += acts[c * each + j] * of_facet[c];
  }
  solve(1 + count * each, factor, y);
  for (int i = 0; i < count; ++i) {
    const int facet = ring[i] / 4;
    const double *acts = along + (size_t)facet * 2 * m * each, *from = y + 1 + i * each;
    const double flux = !flows ? 0.0 : ring[i] % 2 ? y[0] : -y[0];
    double *to = z + (size_t)facet * 2 * m;
    for (int c = 0; c < 2 * m; ++c) {
      double sum = c % 2 ? flux * spread[(size_t)facet * m + c / 2] : 0.0;
      for (int j = 0; j < each; ++j)
        sum += acts[c * each + j] * from[j];
      to[c] += sum;
    }
  }
}

int ring_corrections(int m, long long patches, const int *ring, const int *size, const double *along,
                     const double *spread, const _Bool *flows, const double *factor, const double *r, double *z)
{
  int largest = 1;
  for (long long p = 0; p < patches; ++p)
    largest = size[p] > largest ? size[p] : largest;
  double *y = malloc((1 + (size_t)largest * (2 * m - 1)) * sizeof(double));
  if (!y)
    return -1;
  for (long long p = 0; p < patches; ++p) {
    const int unknowns = 1 + size[p] * (2 * m - 1);
    if (m == 2)
      corrected(2, size[p], ring, along, spread, flows[p], factor, r, z, y);
    else
      corrected(3, size[p], ring, along, spread, flows[p], factor, r, z, y);
    factor += (size_t)unknowns * (unknowns + 1) / 2;
    ring += size[p];
  }
  free(y);
  return 0;
}
