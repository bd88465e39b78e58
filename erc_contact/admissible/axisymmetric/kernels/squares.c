/* Squares of the error in the constitutive relation of rings, see error/rings.py. */
#include "kernels.h"
#include "cell.h"

/* Bernstein polynomials of degree k at barycentric coordinates: vertices first, then the edges opposite to them. */
INLINE void bernstein(const int k, const double *place, double *value)
{
  if (k == 0)
    value[0] = 1.0;
  for (int v = 0; v < 3 && k > 0; ++v) {
    value[v] = k == 1 ? place[v] : place[v] * place[v];
    if (k == 2)
      value[3 + v] = 2 * place[(v + 1) % 3] * place[(v + 2) % 3];
  }
}

INLINE void squares(const int k, long long count, const long long *number, const double *corners, const double *volume,
                    int q, const double *points, const double *weight, long long by_cell, const double *stiffness,
                    const double *compliance, const double *stress, const double *strain, const double *radial,
                    double *square)
{
  const int N = piece_nodes(k), b = body_forces(k);
  for (long long c = 0; c < count; ++c) {
    const long long n = number[c] / 3;
    const int piece = number[c] % 3;
    const double *C = stiffness + n * by_cell, *S = compliance + n * by_cell, *x = corners + 6 * n;
    const double *of_piece = stress + number[c] * N * 4;
    double sum[2] = {0};
    for (int at = 0; at < q; ++at) {
      const double *in_piece = points + 3 * at, middle = in_piece[piece] / 3;
      double place[3], on_piece[6], of_strain[3], of_radial[6], given[4] = {0}, sigma[4] = {0}, off[2][4];
      /* The barycentre replaces a vertex. */
      for (int v = 0; v < 3; ++v)
        place[v] = v == piece ? middle : in_piece[v] + middle;
      const double ring = 2 * M_PI * (place[0] * x[0] + place[1] * x[2] + place[2] * x[4]);
      bernstein(k, in_piece, on_piece);
      bernstein(k - 1, place, of_strain);
      bernstein(k, place, of_radial);
      for (int j = 0; j < b; ++j)
        for (int a = 0; a < 3; ++a)
          given[a] += of_strain[j] * strain[(n * b + j) * 3 + a];
      for (int j = 0; j < N; ++j)
        given[3] += of_radial[j] * radial[n * N + j];
      given[3] *= 2 * M_PI / ring;
      for (int j = 0; j < N; ++j)
        for (int a = 0; a < 4; ++a)
          sigma[a] += on_piece[j] * of_piece[j * 4 + a];
      for (int a = 0; a < 4; ++a) {
        double elastic = 0.0;
        for (int e = 0; e < 4; ++e)
          elastic += C[4 * a + e] * given[e];
        off[0][a] = sigma[a] - ring * elastic;
        off[1][a] = sigma[a] + ring * elastic;
      }
      for (int i = 0; i < 2; ++i)
        for (int a = 0; a < 4; ++a) {
          double dual = 0.0;
          for (int e = 0; e < 4; ++e)
            dual += S[4 * a + e] * off[i][e];
          sum[i] += weight[at] / ring * dual * off[i][a];
        }
    }
    square[2 * c] = volume[n] / 3 * sum[0];
    square[2 * c + 1] = volume[n] / 3 * sum[1];
  }
}

void ring_squares(int k, long long count, const long long *number, const double *corners, const double *volume,
                  int q, const double *points, const double *weight, long long by_cell,
                  const double *stiffness, const double *compliance, const double *stress,
                  const double *strain, const double *radial, double *square)
{
  if (k == 1)
    squares(1, count, number, corners, volume, q, points, weight, by_cell, stiffness, compliance, stress, strain, radial,
            square);
  else
    squares(2, count, number, corners, volume, q, points, weight, by_cell, stiffness, compliance, stress, strain, radial,
            square);
}
