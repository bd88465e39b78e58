/* Squares of the error in the constitutive relation of rings, see error/rings.py. */
#include "kernels.h"
#include "cell.h"

INLINE void squares(const int k, long long count, const long long *number, const double *corners, const double *volume,
                    int q, const double *places, const double *weight, const double *of_piece, const double *of_strain,
                    const double *of_radial, long long by_cell, const double *stiffness, const double *compliance,
                    const double *stress, const double *strain, const double *radial, double *square)
{
  const int N = piece_nodes(k), b = body_forces(k);
  for (long long c = 0; c < count; ++c) {
    const long long n = number[c];
    const double *C = stiffness + n * by_cell, *S = compliance + n * by_cell, *x = corners + 6 * n;
    double sum[2] = {0};
    for (int at = 0; at < 3 * q; ++at) {
      const double *place = places + 3 * at, *values = stress + (n * 3 + at / q) * N * 4;
      const double ring = 2 * M_PI * (place[0] * x[0] + place[1] * x[2] + place[2] * x[4]);
      double given[4] = {0}, sigma[4] = {0}, off[2][4];
      for (int j = 0; j < b; ++j)
        for (int a = 0; a < 3; ++a)
          given[a] += of_strain[at * b + j] * strain[(n * b + j) * 3 + a];
      for (int j = 0; j < N; ++j)
        given[3] += of_radial[at * N + j] * radial[n * N + j];
      given[3] *= 2 * M_PI / ring;
      for (int j = 0; j < N; ++j)
        for (int a = 0; a < 4; ++a)
          sigma[a] += of_piece[at % q * N + j] * values[j * 4 + a];
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
    square[2 * c] = volume[n] * sum[0];
    square[2 * c + 1] = volume[n] * sum[1];
  }
}

void ring_squares(int k, long long count, const long long *number, const double *corners, const double *volume,
                  int q, const double *places, const double *weight, const double *of_piece,
                  const double *of_strain, const double *of_radial, long long by_cell, const double *stiffness,
                  const double *compliance, const double *stress, const double *strain, const double *radial,
                  double *square)
{
  if (k == 1)
    squares(1, count, number, corners, volume, q, places, weight, of_piece, of_strain, of_radial, by_cell, stiffness,
            compliance, stress, strain, radial, square);
  else
    squares(2, count, number, corners, volume, q, places, weight, of_piece, of_strain, of_radial, by_cell, stiffness,
            compliance, stress, strain, radial, square);
}
