/* What is missing in the equilibrium of the stresses of cells, see axisymmetric/missing.py. */
#include "kernels.h"
#include "cell.h"

/* Gradients of the barycentric coordinates of a piece: the barycentre replaces vertex p. */
INLINE void piece_gradients(const double (*about)[2], int p, double (*slope)[2])
{
  double x[3][2];
  for (int v = 0; v < 3; ++v)
    for (int i = 0; i < 2; ++i)
      x[v][i] = v == p ? (about[0][i] + about[1][i] + about[2][i]) / 3 : about[v][i];
  const double a[2] = {x[1][0] - x[0][0], x[1][1] - x[0][1]}, b[2] = {x[2][0] - x[0][0], x[2][1] - x[0][1]};
  const double determinant = a[0] * b[1] - a[1] * b[0];
  slope[1][0] = b[1] / determinant;
  slope[1][1] = -b[0] / determinant;
  slope[2][0] = -a[1] / determinant;
  slope[2][1] = a[0] / determinant;
  for (int i = 0; i < 2; ++i)
    slope[0][i] = -slope[1][i] - slope[2][i];
}

/* S n for a normal n, from Mandel components. */
INLINE void pushed(const double *stress, const double *normal, double *push)
{
  const double shear = M_SQRT1_2 * stress[2];
  push[0] = stress[0] * normal[0] + shear * normal[1];
  push[1] = shear * normal[0] + stress[1] * normal[1];
}

INLINE double squared(const double *a, const double *b)
{
  return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]);
}

/* Squares of the greatest axial force, and of the greatest radial one by which the hoop component is not defined. */
INLINE double in_pieces(const int k, const double (*about)[2], double from, double middle, double volume, double length,
                        const double *gradient, const double *hoop, const double *on_pieces, const double *force,
                        const double *stress)
{
  const int N = piece_nodes(k), b = body_forces(k);
  /* As a radial force: far from the axis the hoop stress is a large multiple of it. */
  const double share = length * fmin(1.0, length / middle);
  double worst = 0.0;
  for (int p = 0; p < 3; ++p) {
    double slope[3][2], divergence[3][2] = {{0}};
    piece_gradients(about, p, slope);
    for (int c = 0; c < b; ++c) {
      for (int a = 0; a < 3; ++a)
        for (int v = 0; v < N; ++v) {
          double push[2];
          pushed(stress + (p * N + v) * 4, slope[a], push);
          divergence[c][0] += gradient[(c * 3 + a) * N + v] * push[0];
          divergence[c][1] += gradient[(c * 3 + a) * N + v] * push[1];
        }
      double axial = divergence[c][1] * volume;
      for (int j = 0; j < b; ++j)
        axial += on_pieces[(p * b + c) * b + j] * force[j];
      worst = fmax(worst, axial * axial);
    }
    for (int v = 0; v < N; ++v) {
      double defined = 0.0;
      for (int a = 0; a < 3; ++a) {
        const double radius = from + (a == p ? (about[0][0] + about[1][0] + about[2][0]) / 3 : about[a][0]);
        for (int c = 0; c < b; ++c)
          defined += hoop[(v * 3 + a) * b + c] * radius * divergence[c][0];
      }
      const double off = (stress[(p * N + v) * 4 + 3] - defined) * share;
      worst = fmax(worst, off * off);
    }
  }
  return worst;
}

INLINE void missing_of(const int k, long long owned, const double *corners, const _Bool *on_axis, const double *area,
                       const int *on_facet, const int *common, const int *ends, const double *gradient,
                       const double *hoop, const double *on_pieces, const double *force, const double *forces,
                       const double *stress, double *missing, double *size)
{
  static const int one[3] = {0, 0, 1}, two[3] = {1, 2, 2};
  static const double none[2] = {0, 0};
  const int N = piece_nodes(k), m = facet_nodes(k), b = body_forces(k);
  for (long long n = 0; n < owned; ++n) {
    const double *x = corners + 6 * n, *S = stress + n * 12 * N, *normal = area + 6 * n;
    /* Far from the axis, coordinates have fewer digits than their differences. */
    double about[3][2], largest = 0.0, longest = 0.0, worst = 0.0;
    for (int i = 0; i < 6; ++i)
      about[i / 2][i % 2] = x[i] - x[i % 2];
    for (int f = 0; f < 3; ++f)
      longest = fmax(longest, squared(normal + 2 * f, none));
    const double length = sqrt(longest), *of_cell = forces + n * 6 * m;
    worst = in_pieces(k, (const double(*)[2])about, x[0], (x[0] + x[2] + x[4]) / 3, fabs(about[1][0] * about[2][1]
                      - about[1][1] * about[2][0]) / 2, length, gradient, hoop, on_pieces, force + n * b, S);
    for (int f = 0; f < 3; ++f)
      for (int j = 0; j < m; ++j) {
        double push[2];
        pushed(S + (f * N + on_facet[f * m + j]) * 4, normal + 2 * f, push);
        worst = fmax(worst, squared(push, of_cell + (f * m + j) * 2));
      }
    for (int pair = 0; pair < 3; ++pair) {
      const int p = one[pair], other = two[pair];
      const double across[2] = {normal[2 * other] - normal[2 * p], normal[2 * other + 1] - normal[2 * p + 1]};
      for (int j = 0; j < m; ++j) {
        double here[2], there[2];
        pushed(S + (p * N + common[(2 * pair) * m + j]) * 4, across, here);
        pushed(S + (other * N + common[(2 * pair + 1) * m + j]) * 4, across, there);
        worst = fmax(worst, squared(here, there));
      }
    }
    for (int at = 0; at < 3 * N; ++at) {
      const double *of_node = S + at * 4;
      const int p = at / N, *end = ends + at % N * 2;
      const double in_plane = of_node[0] * of_node[0] + of_node[1] * of_node[1] + of_node[2] * of_node[2];
      largest = fmax(largest, in_plane + of_node[3] * of_node[3]);
      /* The barycentre is in the place of a vertex. */
      if (end[0] != p && end[1] != p && on_axis[3 * n + end[0]] && on_axis[3 * n + end[1]])
        worst = fmax(worst, in_plane * longest);
    }
    missing[n] = sqrt(worst);
    size[n] = sqrt(largest * longest);
  }
}

void ring_missing(int k, long long owned, const double *corners, const _Bool *on_axis, const double *area,
                  const int *on_facet, const int *common, const int *ends, const double *gradient,
                  const double *hoop, const double *on_pieces, const double *force, const double *forces,
                  const double *stress, double *missing, double *size)
{
  if (k == 1)
    missing_of(1, owned, corners, on_axis, area, on_facet, common, ends, gradient, hoop, on_pieces, force, forces, stress,
               missing, size);
  else
    missing_of(2, owned, corners, on_axis, area, on_facet, common, ends, gradient, hoop, on_pieces, force, forces, stress,
               missing, size);
}
