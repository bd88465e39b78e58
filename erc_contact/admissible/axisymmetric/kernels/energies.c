/* Complementary energies of cells of the half plane, and their stresses, see axisymmetric/elements.py. */
#include "kernels.h"
#include "cell.h"

/* Points that are worked on at once: more of them, and the cache does not suffice. */
enum { POINTS = 3 };

/* The element of a cell, compiled once for each degree: it is called once for a cell. */
static __attribute__((noinline)) void set_element_of(int k, const double *corners, const _Bool *on_axis,
                                                     const double *at_middles, element *it)
{
  if (k == 1)
    set_element(1, corners, on_axis, at_middles, it);
  else
    set_element(2, corners, on_axis, at_middles, it);
}

/* Rows of the four components at a point of a piece, balanced, and what is given there in the place of the body force. */
INLINE void rows_at(const int k, const element *it, const double *table, int piece, const double *hoop, double radius,
                    const double *force, const double *elastic, double (*row)[WIDTH])
{
  const int first = inner(k), w = inputs(k), b = body_forces(k), given = unknowns(k) - 1;
  for (int a = 0; a < 3; ++a)
    stress_row(k, it, table, a, row[a]);
  memset(row[3], 0, sizeof(row[3]));
  for (int j = 0; j < b; ++j)
    row[3][piece * b + j] = radius / it->volume * hoop[j];
  for (int a = 0; a < 4; ++a) {
    for (int c = 0; c < it->count; ++c)
      reflected(k, it->reflector[c], row[a]);
    for (int c = 0; c < it->count; ++c) {
      const double amount = row[a][c];
      for (int j = first & ~(BLOCK - 1); j < w; j += BLOCK)
        AS_BLOCK(row[a] + j) += amount * CONST_BLOCK(it->particular[c] + j);
    }
    double sum = elastic ? -elastic[a] : 0.0;
    for (int j = 0; j < b; ++j)
      sum += row[a][given + j] * force[j];
    row[a][given] = sum;
  }
}

/* The rows times the metric at a point. */
INLINE void set_dual(const int size, const double *compliance, double weight, const double (*row)[WIDTH],
                     double (*dual)[WIDTH])
{
  for (int j = 0; j < size; j += BLOCK)
    for (int a = 0; a < 4; ++a) {
      block sum = {0};
      for (int e = 0; e < 4; ++e)
        sum += weight * compliance[4 * a + e] * CONST_BLOCK(row[e] + j);
      AS_BLOCK(dual[a] + j) = sum;
    }
}

/* energy += rows^T duals of some points, of which the upper triangle counts. */
INLINE void add_products(const int size, int from, const double (*row)[4][WIDTH], const double (*dual)[4][WIDTH],
                         double (*energy)[WIDTH])
{
  for (int i = from; i < size; ++i)
    for (int j = i & ~(BLOCK - 1); j < size; j += BLOCK) {
      block sum = AS_BLOCK(energy[i] + j);
      for (int at = 0; at < POINTS; ++at)
        for (int a = 0; a < 4; ++a)
          sum += row[at][a][i] * CONST_BLOCK(dual[at][a] + j);
      AS_BLOCK(energy[i] + j) = sum;
    }
}

/* Eliminate the inner amounts; their rows, over the diagonal, are written to upper. */
INLINE void eliminate(const int k, int from, double (*energy)[WIDTH], double *upper)
{
  const int first = inner(k), size = unknowns(k);
  if (upper)
    memset(upper, 0, (first - 2) * size * sizeof(double));
  for (int i = from; i < first; ++i) {
    /* An amount that does nothing stays zero. */
    const double share = energy[i][i] > 0 ? 1 / energy[i][i] : 0.0;
    for (int r = i + 1; r < size; ++r) {
      const double times = share * energy[i][r];
      for (int j = r & ~(BLOCK - 1); j < size; j += BLOCK)
        AS_BLOCK(energy[r] + j) -= times * CONST_BLOCK(energy[i] + j);
    }
    for (int j = i + 1; j < size && upper; ++j)
      upper[(i - 2) * size + j] = share * energy[i][j];
  }
}

INLINE void energies(const int k, long long cells, long long owned, const double *corners, const _Bool *on_axis,
                     const double *at_middles, int P, const double *at_points, const double *places,
                     const double *weight, const double *hoop, long long by_cell, long long by_point,
                     const double *compliance, const double *force, const double *elastic, double *matrix,
                     double *slope, double *least, double *upper)
{
  const int first = inner(k), size = unknowns(k), each = 2 * facet_nodes(k), x = 3 * each;
  const int b = body_forces(k), q = P / 3;
  double row[POINTS][4][WIDTH] = {{{0}}}, dual[POINTS][4][WIDTH], energy[WIDTH][WIDTH];
  for (long long n = 0; n < cells; ++n) {
    element it = {0};
    double radius[POINTS];
    const int is_owned = n < owned;
    set_element_of(k, corners + 6 * n, on_axis + 3 * n, at_middles, &it);
    for (int i = 0; i < size; ++i)
      memset(energy[i], 0, in_blocks(size) * sizeof(double));
    for (int from = 0; from < P; from += POINTS) {
      /* What was just written number by number cannot be read as a vector at once: all rows come first. */
      for (int l = 0; l < POINTS; ++l) {
        const int at = from + l;
        const double *place = places + 3 * at;
        radius[l] = place[0] * it.radius[0] + place[1] * it.radius[1] + place[2] * it.radius[2];
        rows_at(k, &it, at_points + (size_t)at * 6 * in_blocks(inputs(k)), at / q, hoop + at % q * b, radius[l], force + n * b,
                is_owned ? elastic + (n * P + at) * 4 : NULL, row[l]);
      }
      for (int l = 0; l < POINTS; ++l)
        set_dual(size, compliance + n * by_cell + (from + l) * by_point,
                 weight[from + l] * it.volume / (2 * M_PI * radius[l]), (const double(*)[WIDTH])row[l], dual[l]);
      add_products(size, it.count, (const double(*)[4][WIDTH])row, (const double(*)[4][WIDTH])dual, energy);
    }
    eliminate(k, it.count, energy, is_owned ? upper + (size_t)n * (first - 2) * size : NULL);
    for (int f = 0; f < 3; ++f)
      for (int g = 0; g <= f; ++g)
        for (int i = 0; i < each; ++i)
          for (int j = 0; j < each; ++j) {
            const int one = f * each + i, two = g * each + j;
            *matrix++ = one < two ? energy[first + one][first + two] : energy[first + two][first + one];
          }
    if (is_owned) {
      for (int i = 0; i < x; ++i)
        slope[n * x + i] = energy[first + i][size - 1];
      least[n] = energy[size - 1][size - 1];
    }
  }
}

void ring_energies(int k, long long cells, long long owned, const double *corners, const _Bool *on_axis,
                   const double *at_middles, int P, const double *at_points, const double *places,
                   const double *weight, const double *hoop, long long by_cell, long long by_point,
                   const double *compliance, const double *force, const double *elastic, double *matrix,
                   double *slope, double *least, double *upper)
{
  (k == 1 ? energies(1, cells, owned, corners, on_axis, at_middles, P, at_points, places, weight, hoop, by_cell,
                     by_point, compliance, force, elastic, matrix, slope, least, upper)
          : energies(2, cells, owned, corners, on_axis, at_middles, P, at_points, places, weight, hoop, by_cell,
                     by_point, compliance, force, elastic, matrix, slope, least, upper));
}

INLINE void stresses(const int k, long long owned, const double *corners, const _Bool *on_axis,
                     const double *at_middles, const double *at_nodes, const double *hoop, const double *force,
                     const double *upper, const double *x, double *stress)
{
  const int first = inner(k), size = unknowns(k), w = inputs(k), N = piece_nodes(k), b = body_forces(k);
  const int forces = 6 * facet_nodes(k), given = size - 1;
  for (long long n = 0; n < owned; ++n) {
    element it = {0};
    double input[WIDTH] = {0}, reference[2][WIDTH];
    set_element_of(k, corners + 6 * n, on_axis + 3 * n, at_middles, &it);
    memcpy(input + first, x + n * forces, forces * sizeof(double));
    /* The amounts of least energy, the last one first: the given part counts once. */
    input[given] = 1.0;
    for (int i = first - 1; i >= it.count; --i) {
      const double *row = upper + ((size_t)n * (first - 2) + i - 2) * size;
      double sum = 0.0;
      for (int j = i + 1; j < size; ++j)
        sum += row[j] * input[j];
      input[i] = -sum;
    }
    memcpy(input + given, force + n * b, b * sizeof(double));
    for (int c = 0; c < it.count; ++c) {
      double sum = 0.0;
      for (int j = first; j < w; ++j)
        sum += it.particular[c][j] * input[j];
      input[c] = sum;
    }
    for (int c = it.count - 1; c >= 0; --c)
      reflected(k, it.reflector[c], input);
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < w; j += BLOCK)
        AS_BLOCK(reference[i] + j) = CONST_BLOCK(it.factor[i] + j) * CONST_BLOCK(input + j);
    for (int at = 0; at < 3 * N; ++at) {
      const double *table = at_nodes + (size_t)at * 6 * in_blocks(w);
      double value[3], *to = stress + (n * 3 * N + at) * 4;
      for (int s = 0; s < 3; ++s) {
        block sum = {0};
        for (int i = 0; i < 2; ++i)
          for (int j = 0; j < w; j += BLOCK)
            sum += CONST_BLOCK(table + (2 * s + i) * in_blocks(w) + j) * CONST_BLOCK(reference[i] + j);
        value[s] = total(sum);
      }
      for (int a = 0; a < 3; ++a)
        to[a] = it.piola[a][0] * value[0] + it.piola[a][1] * value[1] + it.piola[a][2] * value[2];
      const int piece = at / N;
      const double middle = (it.radius[0] + it.radius[1] + it.radius[2]) / 3;
      to[3] = 0.0;
      for (int v = 0; v < 3; ++v)
        for (int j = 0; j < b; ++j)
          to[3] += hoop[(at % N * 3 + v) * b + j] * (v == piece ? middle : it.radius[v]) * input[piece * b + j]
                   / it.volume;
    }
  }
}

void ring_stresses(int k, long long owned, const double *corners, const _Bool *on_axis, const double *at_middles,
                   const double *at_nodes, const double *hoop, const double *force, const double *upper,
                   const double *x, double *stress)
{
  if (k == 1)
    stresses(1, owned, corners, on_axis, at_middles, at_nodes, hoop, force, upper, x, stress);
  else
    stresses(2, owned, corners, on_axis, at_middles, at_nodes, hoop, force, upper, x, stress);
}
