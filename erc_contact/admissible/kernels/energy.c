/* The complementary energy of macro-elements as a quadratic form of facet moments, see tighten/complementary.py. */
#include "kernels.h"
#include "bubbles.h"

enum { MOMENTS = 6, FORCES = 12 };

/* Cells side by side: geometry, material, tractions and stresses. */
typedef struct {
  lanes corner[3][3], inverse[3][3], determinant, volume, sign[4];
  lanes metric[21 * POINTS], input[INPUTS], coefficient[INPUTS], stress[VALUES], dual[VALUES], added[VALUES];
  lanes push[3][3], amount[BUBBLES];
} group;

/* y += A x for a sparse matrix A, or a full one, of these rows and columns. */
INLINE void sparse(int rows, int columns, const int *start, const int *column, const double *value,
                   const lanes *const *x, lanes *const *y)
{
  if (start[rows] == rows * columns)
    matrix_times_groups(rows, columns, value, x, y);
  else
    for (int i = 0; i < rows; ++i)
      for (int g = 0; g < GROUPS; ++g) {
        lanes sum = {0};
        for (int k = start[i]; k < start[i + 1]; ++k)
          sum += value[k] * x[g][column[k]];
        y[g][i] += sum;
      }
}

/* Coefficients of the reference tractions of a cell from their moments, less the coefficients of a constant stress. */
INLINE void reference_coefficients(const int d, int m, const lanes *sign, lanes (*inverse)[3], lanes volume,
                                   const double *facet_map, int has_mean, lanes (*push)[3], const lanes *input,
                                   lanes *coefficient)
{
  for (int f = 0; f <= d; ++f) {
    lanes gradient[3], reference[MOMENTS][3];
    for (int i = 0; i < d; ++i)
      gradient[i] = f ? inverse[f - 1][i] : d == 2 ? -inverse[0][i] - inverse[1][i]
                                                   : -inverse[0][i] - inverse[1][i] - inverse[2][i];
    for (int j = 0; j < m; ++j) {
      lanes moment[3];
      for (int i = 0; i < d; ++i) {
        moment[i] = sign[f] * input[(f * m + j) * d + i];
        if (has_mean && j < d)
          moment[i] += volume * dot(d, push[i], gradient);
      }
      for (int i = 0; i < d; ++i)
        reference[j][i] = dot(d, inverse[i], moment);
    }
    for (int j = 0; j < m; ++j)
      for (int i = 0; i < d; ++i) {
        lanes sum = {0};
        for (int k = 0; k < m; ++k)
          sum += facet_map[j * m + k] * reference[k][i];
        coefficient[(f * m + j) * d + i] = sum;
      }
  }
}

/* The transpose of reference_coefficients. */
INLINE void moments_back(const int d, int m, const lanes *sign, lanes (*inverse)[3], const double *facet_map,
                         const lanes *coefficient, lanes *input)
{
  for (int f = 0; f <= d; ++f) {
    lanes reference[MOMENTS][3];
    for (int k = 0; k < m; ++k)
      for (int i = 0; i < d; ++i) {
        lanes sum = {0};
        for (int j = 0; j < m; ++j)
          sum += facet_map[j * m + k] * coefficient[(f * m + j) * d + i];
        reference[k][i] = sum;
      }
    for (int k = 0; k < m; ++k)
      for (int i = 0; i < d; ++i) {
        lanes sum = {0};
        for (int r = 0; r < d; ++r)
          sum += inverse[r][i] * reference[k][r];
        input[(f * m + k) * d + i] = sign[f] * sum;
      }
  }
}

/* The mean of the elastic stress as a tensor, and what is beside it, pulled back to the reference simplex, as stresses. */
INLINE void offsets(const int d, int b, const double *of_mean, const int *start, const int *column,
                    const double *value, int Q, const lanes (*elastic)[6], group *it)
{
  static const int first[2][6] = {{0, 1, 0}, {0, 1, 2, 0, 0, 1}}, second[2][6] = {{0, 1, 1}, {0, 1, 2, 1, 2, 2}};
  const int s = d * (d + 1) / 2;
  lanes mean[6] = {{0}}, deviation[VALUES];
  for (int c = 0; c < b; ++c)
    for (int a = 0; a < s; ++a)
      mean[a] += of_mean[c] * elastic[c][a];
  for (int a = 0; a < s; ++a) {
    const int i = first[d - 2][a], j = second[d - 2][a];
    it->push[i][j] = it->push[j][i] = (a < d ? 1.0 : M_SQRT1_2) * mean[a];
  }
  if (b == 1)
    return;
  for (int c = 0; c < b; ++c)
    for (int a = 0; a < s; ++a)
      deviation[c * s + a] = mean[a] - elastic[c][a];
  pull_back(d, it->inverse, it->determinant, b, deviation);
  spread(s, Q, start, column, value, deviation, it->stress);
}

INLINE double energy(const int d, int m, long long begin, long long cells, const double *edges, const int *facets,
                     const long long *side, const double *compliance, int varies, int points,
                     const double *facet_map, int Q, const int *start, const int *column, const double *value,
                     const int *back_start, const int *back_column, const double *back_value,
                     const int *weight_start, const int *weight_column, const double *weight, int count,
                     const double *bubbles, const double *transposed, const double *products, int b,
                     const double *elastic, const double *of_mean, const int *elastic_start,
                     const int *elastic_column, const double *elastic_value, int forces, const double *force,
                     const double *body, const double *x, double *y)
{
  const int s = d * (d + 1) / 2, inputs = (d + 1) * m * d;
  double result = 0.0;
  group *work = aligned_alloc(sizeof(lanes), GROUPS * sizeof(group));
  if (!work)
    return -1.0;
  const lanes *metric[GROUPS], *inputs_of[GROUPS], *stress[GROUPS], *dual[GROUPS], *amount[GROUPS];
  lanes *to_stress[GROUPS], *to_input[GROUPS], *to_amount[GROUPS], *added[GROUPS];
  for (int g = 0; g < GROUPS; ++g) {
    metric[g] = work[g].metric;
    inputs_of[g] = to_input[g] = work[g].coefficient;
    stress[g] = to_stress[g] = work[g].stress;
    amount[g] = to_amount[g] = work[g].amount;
    dual[g] = work[g].dual;
    added[g] = work[g].added;
  }
  for (long long first = begin; first < cells; first += GROUPS * LANES) {
    for (int g = 0; g < GROUPS; ++g) {
      group *it = work + g;
      lanes given[POINTS][6], inside[FORCES] = {{0}};
      memset(it->stress, 0, Q * s * sizeof(lanes));
      for (int l = 0; l < LANES; ++l) {
        const long long cell = cell_of(first, g * LANES + l, cells);
        for (int i = 0; i < d * d; ++i)
          it->corner[i / d][i % d][l] = edges[cell * d * d + i];
        for (int f = 0; f <= d; ++f) {
          const long long place = cell * (d + 1) + f;
          it->sign[f][l] = side[facets[place]] == place ? 1.0 : -1.0;
          for (int i = 0; i < m * d; ++i)
            it->input[f * m * d + i][l] = x[(long long)facets[place] * m * d + i];
        }
        for (int i = 0; i < b * s && elastic; ++i)
          given[i / s][i % s][l] = elastic[cell * b * s + i];
        for (int i = 0; i < forces && force; ++i)
          inside[i][l] = force[cell * forces + i];
      }
      it->determinant = inverted(d, it->corner, it->inverse);
      it->volume = absolute(it->determinant) / (d == 2 ? 2.0 : 6.0);
      metrics(d, first, g * LANES, cells, it->corner, it->determinant, compliance, varies, points, it->metric);
      if (elastic)
        offsets(d, b, of_mean, elastic_start, elastic_column, elastic_value, Q, (const lanes(*)[6])given, it);
      if (force) {
        lanes reference[FORCES];
        for (int i = 0; i < forces; ++i)
          reference[i] = dot(d, it->inverse[i % d], inside + i / d * d);
        matrix_times(Q * s, forces, body, reference, it->stress);
      }
      reference_coefficients(d, m, it->sign, it->inverse, it->volume, facet_map, elastic != NULL, it->push, it->input,
                             it->coefficient);
    }
    sparse(Q * s, inputs, start, column, value, inputs_of, to_stress);
    for (int g = 0; g < GROUPS; ++g)
      duals(s, Q, points > 1, metric[g], weight_start, weight_column, weight, stress[g], work[g].dual);
    if (count) {
      amounts(GROUPS, s, Q, points > 1, count, bubbles, transposed, products, metric, dual, to_amount);
      for (int g = 0; g < GROUPS; ++g)
        memset(added[g], 0, Q * s * sizeof(lanes));
      matrix_times_groups(Q * s, count, bubbles, amount, added);
    }
    for (int g = 0; g < GROUPS; ++g) {
      group *it = work + g;
      if (count) {
        /* The strains of the bubbles of least energy are taken away. */
        lanes strain[VALUES];
        duals(s, Q, points > 1, metric[g], weight_start, weight_column, weight, it->added, strain);
        for (int i = 0; i < Q * s; ++i)
          it->dual[i] -= strain[i];
      }
      lanes square[6] = {{0}};
      for (int q = 0; q < Q; ++q)
        for (int a = 0; a < s; ++a)
          square[a] += it->stress[q * s + a] * it->dual[q * s + a];
      for (int a = 1; a < s; ++a)
        square[0] += square[a];
      for (int l = 0; l < LANES && first + g * LANES + l < cells; ++l)
        result += square[0][l];
      memset(it->coefficient, 0, inputs * sizeof(lanes));
    }
    sparse(inputs, Q * s, back_start, back_column, back_value, dual, to_input);
    for (int g = 0; g < GROUPS; ++g) {
      group *it = work + g;
      moments_back(d, m, it->sign, it->inverse, facet_map, it->coefficient, it->input);
      for (int l = 0; l < LANES && first + g * LANES + l < cells; ++l)
        for (int f = 0; f <= d; ++f) {
          double *to = y + (long long)facets[(first + g * LANES + l) * (d + 1) + f] * m * d;
          for (int i = 0; i < m * d; ++i)
            to[i] += it->input[f * m * d + i][l];
        }
    }
  }
  free(work);
  return result;
}

double macro_energy(int m, long long begin, long long cells, const double *edges, const int *facets,
                    const long long *side, const double *compliance, int varies, int points, const double *facet_map, int Q,
                    const int *start, const int *column, const double *value, const int *back_start,
                    const int *back_column, const double *back_value, const int *weight_start,
                    const int *weight_column, const double *weight, int count, const double *bubbles,
                    const double *transposed, const double *products, int b, const double *elastic,
                    const double *of_mean, const int *elastic_start, const int *elastic_column,
                    const double *elastic_value, int forces, const double *force, const double *body,
                    const double *x, double *y)
{
  return energy(DIMENSION, m, begin, cells, edges, facets, side, compliance, varies, points, facet_map, Q, start, column,
                value, back_start, back_column, back_value, weight_start, weight_column, weight, count, bubbles, transposed,
                products, b, elastic, of_mean, elastic_start, elastic_column, elastic_value, forces, force, body, x, y);
}
