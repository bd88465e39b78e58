/* Complementary energies of cells of the half plane, and their stresses, see axisymmetric/elements.py. */
#include "kernels.h"
#include "cell.h"

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
      reflected(k, it->reflector[c], c, row[a]);
    for (int c = 0; c < it->count; ++c)
      for (int j = first; j < w; ++j)
        row[a][j] += row[a][c] * it->particular[c][j];
    double sum = elastic ? -elastic[a] : 0.0;
    for (int j = 0; j < b; ++j)
      sum += row[a][given + j] * force[j];
    row[a][given] = sum;
  }
}

/* energy += rows^T metric rows, of which the upper triangle counts. */
INLINE void add_products(const int size, int from, const double *compliance, double weight,
                         const double (*row)[WIDTH], double (*energy)[WIDTH])
{
  double dual[4][WIDTH];
  for (int a = 0; a < 4; ++a)
    for (int j = 0; j < size; ++j)
      dual[a][j] = weight
                   * (compliance[4 * a] * row[0][j] + compliance[4 * a + 1] * row[1][j]
                      + compliance[4 * a + 2] * row[2][j] + compliance[4 * a + 3] * row[3][j]);
  for (int i = from; i < size; ++i)
    /* Whole vectors of the processor. */
    for (int j = i & ~7; j < size; ++j)
      energy[i][j] += row[0][i] * dual[0][j] + row[1][i] * dual[1][j] + row[2][i] * dual[2][j] + row[3][i] * dual[3][j];
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
      for (int j = r & ~7; j < size; ++j)
        energy[r][j] -= times * energy[i][j];
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
  const int first = inner(k), size = unknowns(k), x = 6 * facet_nodes(k), b = body_forces(k), q = P / 3;
  for (long long n = 0; n < cells; ++n) {
    element it;
    double energy[WIDTH][WIDTH] = {{0}}, row[4][WIDTH];
    const int is_owned = n < owned;
    set_element(k, corners + 6 * n, on_axis + 3 * n, at_middles, &it);
    for (int at = 0; at < P; ++at) {
      const double *place = places + 3 * at;
      const double radius = place[0] * it.radius[0] + place[1] * it.radius[1] + place[2] * it.radius[2];
      rows_at(k, &it, at_points + (size_t)at * 6 * inputs(k), at / q, hoop + at % q * b, radius, force + n * b,
              is_owned ? elastic + (n * P + at) * 4 : NULL, row);
      add_products(size, it.count, compliance + n * by_cell + at * by_point,
                   weight[at] * it.volume / (2 * M_PI * radius), (const double(*)[WIDTH])row, energy);
    }
    eliminate(k, it.count, energy, is_owned ? upper + (size_t)n * (first - 2) * size : NULL);
    for (int i = 0; i < x; ++i)
      for (int j = i; j < x; ++j)
        matrix[(n * x + i) * x + j] = matrix[(n * x + j) * x + i] = energy[first + i][first + j];
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
    element it;
    double input[WIDTH] = {0}, reference[2][WIDTH];
    set_element(k, corners + 6 * n, on_axis + 3 * n, at_middles, &it);
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
      reflected(k, it.reflector[c], c, input);
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < w; ++j)
        reference[i][j] = it.factor[i][j] * input[j];
    for (int at = 0; at < 3 * N; ++at) {
      const double *table = at_nodes + (size_t)at * 6 * w;
      double value[3] = {0}, *to = stress + (n * 3 * N + at) * 4;
      for (int s = 0; s < 3; ++s)
        for (int i = 0; i < 2; ++i)
          for (int j = 0; j < w; ++j)
            value[s] += table[(2 * s + i) * w + j] * reference[i][j];
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
