/* The bubbles that bring a stress nearest to an elastic one, see tighten/complementary.py. */
#include "kernels.h"
#include "bubbles.h"

enum { NODES = 40 };

INLINE void relax(const int d, int nodes, long long cells, const double *edges, const double *compliance, int varies,
                  int points, int Q, const int *row_start, const int *row_column, const double *row_value,
                  const int *weight_start, const int *weight_column, const double *weight, int count,
                  const double *nodal_bubbles, const double *bubbles, const double *transposed,
                  const double *products, int b, const double *elastic, const int *elastic_start,
                  const int *elastic_column, const double *elastic_value, double *sigma)
{
  const int s = d * (d + 1) / 2;
  for (long long first = 0; first < cells; first += LANES) {
    const int here = cells - first < LANES ? (int)(cells - first) : LANES;
    lanes corner[3][3], inverse[3][3], P[6][6], metric[21 * POINTS], stress[6 * NODES], given[VALUES];
    lanes difference[VALUES], dual[VALUES], amount[BUBBLES], added[6 * NODES];
    for (int l = 0; l < LANES; ++l) {
      const long long cell = cell_of(first, l, cells);
      for (int i = 0; i < d * d; ++i)
        corner[i / d][i % d][l] = edges[cell * d * d + i];
      for (int i = 0; i < nodes * s; ++i)
        stress[i][l] = sigma[cell * nodes * s + i];
      for (int i = 0; i < b * s; ++i)
        given[i][l] = -elastic[cell * b * s + i];
    }
    const lanes determinant = inverted(d, corner, inverse);
    const lanes share = 1.0 / absolute(determinant);
    metrics(d, first, 0, cells, corner, determinant, compliance, varies, points, metric);
    memset(difference, 0, Q * s * sizeof(lanes));
    spread(s, Q, row_start, row_column, row_value, stress, difference);
    spread(s, Q, elastic_start, elastic_column, elastic_value, given, difference);
    pull_back(d, inverse, determinant, Q, difference);
    duals(s, Q, points > 1, metric, weight_start, weight_column, weight, difference, dual);
    const lanes *metric_of = metric, *dual_of = dual;
    lanes *amount_of = amount;
    amounts(1, s, Q, points > 1, count, bubbles, transposed, products, &metric_of, &dual_of, &amount_of);
    memset(added, 0, nodes * s * sizeof(lanes));
    matrix_times(nodes * s, count, nodal_bubbles, amount, added);
    images(d, corner, P);
    for (int q = 0; q < nodes; ++q)
      for (int a = 0; a < s; ++a) {
        lanes value = {0};
        for (int k = 0; k < s; ++k)
          value += added[q * s + k] * P[k][a];
        value = stress[q * s + a] - share * value;
        for (int l = 0; l < here; ++l)
          sigma[((first + l) * nodes + q) * s + a] = value[l];
      }
  }
}

void relax_stresses(int nodes, long long cells, const double *edges, const double *compliance, int varies,
                    int points, int Q, const int *row_start, const int *row_column, const double *row_value,
                    const int *weight_start, const int *weight_column, const double *weight, int count,
                    const double *nodal_bubbles, const double *bubbles, const double *transposed,
                    const double *products, int b, const double *elastic, const int *elastic_start,
                    const int *elastic_column, const double *elastic_value, double *sigma)
{
  relax(DIMENSION, nodes, cells, edges, compliance, varies, points, Q, row_start, row_column, row_value, weight_start,
        weight_column, weight, count, nodal_bubbles, bubbles, transposed, products, b, elastic, elastic_start,
        elastic_column, elastic_value, sigma);
}
