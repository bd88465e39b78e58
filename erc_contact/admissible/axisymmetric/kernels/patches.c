/* Energies of facet forces of the half plane, and their small problems on patches, see axisymmetric/tighten.py.

   A step of a ring is 2 pair + q, as in tighten/rings.py, with pair / 2 the facet; q = 1 if its first cell follows. The
   unknowns of a patch are its flux, then 2 m - 1 amounts on each facet. */
#include "kernels.h"
#include "cell.h"

/* The block of energies of a cell between its facets f >= g. */
INLINE const double *block_of(const int each, const double *matrix, long long cell, int f, int g)
{
  return matrix + (cell * 6 + f * (f + 1) / 2 + g) * each * each;
}

INLINE double product_with(const int each, long long owned, const int *facets, const long long *side,
                           const double *matrix, const double *slope, const double *forces, double *y)
{
  const int x = 3 * each;
  double energy = 0.0;
  for (long long n = 0; n < owned; ++n) {
    double input[18], image[18] = {0}, sign[3];
    for (int f = 0; f < 3; ++f) {
      sign[f] = side[facets[3 * n + f]] == 3 * n + f ? 1.0 : -1.0;
      for (int i = 0; i < each; ++i)
        input[f * each + i] = sign[f] * forces[(long long)facets[3 * n + f] * each + i];
    }
    for (int f = 0; f < 3; ++f)
      for (int g = 0; g <= f; ++g) {
        const double *entry = block_of(each, matrix, n, f, g);
        for (int i = 0; i < each; ++i)
          for (int j = 0; j < each; ++j) {
            image[f * each + i] += entry[i * each + j] * input[g * each + j];
            if (f > g)
              image[g * each + j] += entry[i * each + j] * input[f * each + i];
          }
      }
    for (int i = 0; i < x; ++i) {
      energy += input[i] * image[i];
      if (slope) {
        energy += 2 * input[i] * slope[n * x + i];
        image[i] += slope[n * x + i];
      }
    }
    for (int f = 0; f < 3; ++f)
      for (int i = 0; i < each; ++i)
        y[(long long)facets[3 * n + f] * each + i] += sign[f] * image[f * each + i];
  }
  return energy;
}

double ring_energy(int k, long long owned, const int *facets, const long long *side, const double *matrix,
                   const double *slope, const double *x, double *y)
{
  return k == 1 ? product_with(4, owned, facets, side, matrix, slope, x, y)
                : product_with(6, owned, facets, side, matrix, slope, x, y);
}

/* Energies of a cell for what acts on its facets f >= g, in terms of their bases (2 m, BLOCK): an axial force of 1, then
   the amounts of the facet. */
INLINE void energies_between(const int m, const double *entry, const double *basis_f, const double *basis_g,
                             double (*energy)[BLOCK])
{
  const int size = 2 * m;
  block half[6];
  for (int i = 0; i < size; ++i) {
    half[i] = (block){0};
    for (int j = 0; j < size; ++j)
      half[i] += entry[i * size + j] * CONST_BLOCK(basis_g + j * BLOCK);
  }
  for (int e = 0; e < size; ++e) {
    block sum = {0};
    for (int i = 0; i < size; ++i)
      sum += basis_f[i * BLOCK + e] * half[i];
    AS_BLOCK(energy[e]) = sum;
  }
}

/* Add them to the upper triangle of A, of rows apart by stride. The flux is unknown 0, and acts on both facets. */
INLINE void add_energies(const int m, const double (*energy)[BLOCK], double sign, double flux_f, double flux_g, int first_f,
                         int first_g, int stride, double *A)
{
  const int each = 2 * m - 1;
  if (first_f == first_g) {
    A[0] += flux_f * flux_f * energy[0][0];
    for (int c = 0; c < each; ++c) {
      A[first_f + c] += flux_f * energy[0][1 + c];
      for (int e = 0; e < each; ++e)
        A[(first_f + e) * stride + first_f + c] += energy[1 + e][1 + c];
    }
    return;
  }
  A[0] += 2 * sign * flux_f * flux_g * energy[0][0];
  for (int c = 0; c < each; ++c) {
    A[first_g + c] += sign * flux_f * energy[0][1 + c];
    A[first_f + c] += sign * flux_g * energy[1 + c][0];
    for (int e = 0; e < each; ++e)
      if (first_f < first_g)
        A[(first_f + e) * stride + first_g + c] += sign * energy[1 + e][1 + c];
      else
        A[(first_g + c) * stride + first_f + e] += sign * energy[1 + e][1 + c];
  }
}

/* The matrix of a patch. */
INLINE void assemble(const int m, int count, const int *ring, const int *facets, const long long *side, long long F,
                     const int *kind, const double *bases, _Bool flows, const double *matrix, int stride, double *A)
{
  const int each = 2 * m - 1, entries = 2 * m * BLOCK;
  for (int i = 0; i < count; ++i) {
    const int facet = ring[i] / 4, beyond = ring[i] % 2 == 0;
    if (beyond && side[F + facet] == side[facet])
      continue;
    const long long cell = side[beyond ? F + facet : facet] / 3;
    const int next = (i + 1) % count, ends = next == i ? 1 : 2, number[2] = {i, next};
    const double *basis[2];
    double sign[2], flux[2], energy[6][BLOCK];
    int local[2], first[2];
    for (int e = 0; e < ends; ++e) {
      const int code = ring[number[e]], here = code / 4;
      local[e] = facets[3 * cell] == here ? 0 : facets[3 * cell + 1] == here ? 1 : 2;
      sign[e] = side[here] == 3 * cell + local[e] ? 1.0 : -1.0;
      flux[e] = !flows ? 0.0 : code % 2 ? 1.0 : -1.0;
      first[e] = 1 + number[e] * each;
      basis[e] = bases + (size_t)kind[here] * entries;
    }
    for (int e = 0; e < ends; ++e)
      for (int g = 0; g < ends; ++g) {
        if (local[e] < local[g])
          continue;
        energies_between(m, block_of(2 * m, matrix, cell, local[e], local[g]), basis[e], basis[g], energy);
        add_energies(m, (const double(*)[BLOCK])energy, sign[e] * sign[g], flux[e], flux[g], first[e], first[g], stride, A);
      }
  }
}

/* Factor U of A = U^T U, row by row, with the inverses of its diagonal: 0 for what has no energy of its own. A is lost. */
INLINE void factorise(int size, int stride, double *A, double *factor)
{
  for (int i = 0; i < size; ++i) {
    double *row = A + (size_t)i * stride;
    /* Behind the rows stand the diagonals of A. */
    const double share = row[i] > 1e-14 * A[(size_t)size * stride + i] ? 1 / sqrt(row[i]) : 0.0;
    for (int j = i & ~(BLOCK - 1); j < stride; j += BLOCK)
      AS_BLOCK(row + j) *= share;
    for (int r = i + 1; r < size; ++r) {
      double *other = A + (size_t)r * stride;
      const double times = row[r];
      for (int j = r & ~(BLOCK - 1); j < stride; j += BLOCK)
        AS_BLOCK(other + j) -= times * CONST_BLOCK(row + j);
    }
    *factor++ = share;
    memcpy(factor, row + i + 1, (size - i - 1) * sizeof(double));
    factor += size - i - 1;
  }
}

/* The greatest number of unknowns of a patch. */
INLINE int most_unknowns(int m, long long patches, const int *size)
{
  int largest = 1;
  for (long long p = 0; p < patches; ++p)
    largest = size[p] > largest ? size[p] : largest;
  return 1 + largest * (2 * m - 1);
}

int ring_patches(int m, long long patches, const int *ring, const int *size, const int *facets,
                 const long long *side, long long F, const int *kind, const double *bases,
                 const _Bool *flows, const double *matrix, double *factor)
{
  const size_t most = in_blocks(most_unknowns(m, patches, size));
  double *A = aligned_alloc(BLOCK * sizeof(double), (most + 1) * most * sizeof(double));
  if (!A)
    return -1;
  for (long long p = 0; p < patches; ++p) {
    const int unknowns = 1 + size[p] * (2 * m - 1), stride = in_blocks(unknowns);
    memset(A, 0, (size_t)unknowns * stride * sizeof(double));
    if (m == 2)
      assemble(2, size[p], ring, facets, side, F, kind, bases, flows[p], matrix, stride, A);
    else
      assemble(3, size[p], ring, facets, side, F, kind, bases, flows[p], matrix, stride, A);
    for (int i = 0; i < unknowns; ++i)
      A[(size_t)unknowns * stride + i] = A[(size_t)i * stride + i];
    factorise(unknowns, stride, A, factor);
    factor += (size_t)unknowns * (unknowns + 1) / 2;
    ring += size[p];
  }
  free(A);
  return 0;
}

/* Solve with such a factor, in place. */
INLINE void solve(int size, const double *factor, double *y)
{
  for (int i = 0; i < size; ++i) {
    y[i] *= *factor++;
    for (int j = i + 1; j < size; ++j)
      y[j] -= *factor++ * y[i];
  }
  for (int i = size - 1; i >= 0; --i) {
    factor -= size - i;
    double sum[4] = {y[i], 0, 0, 0};
    int j = 1;
    /* Four sums at once hide how long each of them takes. */
    for (; j + 3 < size - i; j += 4)
      for (int l = 0; l < 4; ++l)
        sum[l] -= factor[j + l] * y[i + j + l];
    for (; j < size - i; ++j)
      sum[0] -= factor[j] * y[i + j];
    y[i] = ((sum[0] + sum[1]) + (sum[2] + sum[3])) * factor[0];
  }
}

/* Add to z what the unknowns y of a patch are on its facets, for the residual r. */
INLINE void corrected(const int m, int count, const int *ring, const int *kind, const double *bases, _Bool flows,
                      const double *factor, const double *r, double *z, double *y)
{
  const int each = 2 * m - 1, size = 2 * m;
  y[0] = 0.0;
  for (int i = 0; i < count; ++i) {
    const int facet = ring[i] / 4;
    const double *acts = bases + (size_t)kind[facet] * size * BLOCK;
    block work = {0};
    for (int c = 0; c < size; ++c)
      work += r[(size_t)facet * size + c] * CONST_BLOCK(acts + c * BLOCK);
    if (flows)
      y[0] += ring[i] % 2 ? work[0] : -work[0];
    for (int j = 0; j < each; ++j)
      y[1 + i * each + j] = work[1 + j];
  }
  solve(1 + count * each, factor, y);
  for (int i = 0; i < count; ++i) {
    const int facet = ring[i] / 4;
    const double *acts = bases + (size_t)kind[facet] * size * BLOCK;
    double amount[BLOCK] = {!flows ? 0.0 : ring[i] % 2 ? y[0] : -y[0]};
    memcpy(amount + 1, y + 1 + i * each, each * sizeof(double));
    for (int c = 0; c < size; ++c) {
      double sum = 0.0;
      for (int j = 0; j < size; ++j)
        sum += acts[c * BLOCK + j] * amount[j];
      z[(size_t)facet * size + c] += sum;
    }
  }
}

int ring_corrections(int m, long long patches, const int *ring, const int *size, const int *kind,
                     const double *bases, const _Bool *flows, const double *factor, const double *r, double *z)
{
  double *y = malloc(most_unknowns(m, patches, size) * sizeof(double));
  if (!y)
    return -1;
  for (long long p = 0; p < patches; ++p) {
    const int unknowns = 1 + size[p] * (2 * m - 1);
    if (m == 2)
      corrected(2, size[p], ring, kind, bases, flows[p], factor, r, z, y);
    else
      corrected(3, size[p], ring, kind, bases, flows[p], factor, r, z, y);
    factor += (size_t)unknowns * (unknowns + 1) / 2;
    ring += size[p];
  }
  free(y);
  return 0;
}
