/* The bubbles that bring a stress nearest to an elastic one, see tighten/complementary.py. */
#include "kernels.h"
#include "bubbles.h"

enum { NODES = 40 };

/* y += A x for a sparse matrix A of these rows and vectors of s components. */
INLINE void spread(const int s, int rows, const int *start, const int *column, const double *value, const lanes *x,
                   lanes *y)
{
  for (int q = 0; q < rows; ++q)
    for (int k = start[q]; k < start[q + 1]; ++k)
      for (int a = 0; a < s; ++a)
        y[q * s + a] += value[k] * x[column[k] * s + a];
}

INLINE void relax(const int d, int nodes, long long cells, const double *edges, const double *compliance, int varies,
                  int points, int Q, const int *row_start, const int *row_column, const double *row_value,
                  const int *weight_start, const int *weight_column, const double *weight, int count,
                  const double *nodal_bubbles, const double *bubbles, const double *transposed,
                  const double *products, int b, const double *elastic, const int *elastic_start,
                  const int *elastic_column, const double *elastic_value, double *sigma)
{
  const int s = d * (d + 1) / 2, t = s * (s + 1) / 2;
  for (long long first = 0; first < cells; first += LANES) {
    const int here = cells - first < LANES ? (int)(cells - first) : LANES;
    lanes corner[3][3], P[6][6], C[36], metric[21 * POINTS], stress[6 * NODES], given[VALUES], rows[VALUES];
    lanes strain[VALUES], dual[VALUES], amount[BUBBLES], added[6 * NODES];
    for (int l = 0; l < LANES; ++l) {
      const long long cell = first + (l < here ? l : 0);
      for (int i = 0; i < d * d; ++i)
        corner[i / d][i % d][l] = edges[cell * d * d + i];
      for (int i = 0; i < nodes * s; ++i)
        stress[i][l] = sigma[cell * nodes * s + i];
      for (int i = 0; i < b * s; ++i)
        given[i][l] = -elastic[cell * b * s + i];
    }
    lanes inverse[3][3];
    const lanes determinant = inverted(d, corner, inverse);
    const lanes share = 1.0 / absolute(determinant);
    images(d, corner, P);
    memset(rows, 0, Q * s * sizeof(lanes));
    spread(s, Q, row_start, row_column, row_value, stress, rows);
    spread(s, Q, elastic_start, elastic_column, elastic_value, given, rows);
    for (int q = 0; q < Q; ++q) {
      const int at = points > 1 ? q : 0;
      if (q == at) {
        for (int k = 0; k < s * s; ++k) {
          C[k] = compliance[at * s * s + k] * ONE;
          for (int l = 0; l < LANES && varies; ++l)
            C[k][l] = compliance[((first + (l < here ? l : 0)) * points + at) * s * s + k];
        }
        reference_metric(d, corner, determinant, C, metric + at * t);
      }
      lanes physical[6];
      for (int a = 0; a < s; ++a)
        physical[a] = dot(s, C + a * s, rows + q * s);
      for (int a = 0; a < s; ++a)
        strain[q * s + a] = dot(s, P[a], physical) / (d == 2 ? 2.0 : 6.0);
    }
    for (int q = 0; q < Q; ++q) {
      lanes sum[6] = {{0}};
      for (int k = weight_start[q]; k < weight_start[q + 1]; ++k)
        for (int a = 0; a < s; ++a)
          sum[a] += weight[k] * strain[weight_column[k] * s + a];
      memcpy(dual + q * s, sum, s * sizeof(lanes));
    }
    const lanes *metric_of = metric, *dual_of = dual;
    lanes *amount_of = amount;
    amounts(1, s, Q, points > 1, count, bubbles, transposed, products, &metric_of, &dual_of, &amount_of);
    memset(added, 0, nodes * s * sizeof(lanes));
    matrix_times(nodes * s, count, nodal_bubbles, amount, added);
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

void relax_stresses(int d, int nodes, long long cells, const double *edges, const double *compliance, int varies,
                    int points, int Q, const int *row_start, const int *row_column, const double *row_value,
                    const int *weight_start, const int *weight_column, const double *weight, int count,
                    const double *nodal_bubbles, const double *bubbles, const double *transposed,
                    const double *products, int b, const double *elastic, const int *elastic_start,
                    const int *elastic_column, const double *elastic_value, double *sigma)
{
#define RELAX(d) relax(d, nodes, cells, edges, compliance, varies, points, Q, row_start, row_column, row_value, \
    weight_start, weight_column, weight, count, nodal_bubbles, bubbles, transposed, products, b, elastic, \
    elastic_start, elastic_column, elastic_value, sigma)
  if (d == 2)
    RELAX(2);
  else
    RELAX(3);
}
