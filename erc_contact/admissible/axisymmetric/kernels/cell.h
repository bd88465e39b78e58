/* A cell of the half plane, and the balance of its inner amounts, see axisymmetric/elements.py.

   A row has a number for each input of a cell: the inner amounts (hoop forces of the pieces, then bubbles), the forces on
   its facets, and its axial body force. */
#ifndef CELL_H
#define CELL_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))

/* Columns of a row, and those that are worked on at once: whole vectors of the processor. What stands behind the last
   column does not count. */
enum { WIDTH = 40, BLOCK = 8, CONDITIONS = 3, MOST_INNER = 16 };

typedef double block __attribute__((vector_size(8 * BLOCK), aligned(8), may_alias));
#define AS_BLOCK(x) (*(block *)(x))
#define CONST_BLOCK(x) (*(const block *)(x))

INLINE int in_blocks(const int columns) { return (columns + BLOCK - 1) & ~(BLOCK - 1); }

INLINE double total(block x) { return ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7])); }

INLINE int facet_nodes(const int k) { return k + 1; }
INLINE int piece_nodes(const int k) { return (k + 1) * (k + 2) / 2; }
INLINE int body_forces(const int k) { return k * (k + 1) / 2; }
INLINE int bubbles(const int k) { return k == 1 ? 0 : 3; }
INLINE int inner(const int k) { return 3 * body_forces(k) + bubbles(k); }
INLINE int inputs(const int k) { return inner(k) + 6 * facet_nodes(k) + body_forces(k); }
/* Inputs with the body force as one: what is given. */
INLINE int unknowns(const int k) { return inner(k) + 6 * facet_nodes(k) + 1; }

/* Conditions are two: radial force and moment. A cell with an edge on the axis has S_zz = 0 in its middle at k = 2. */
typedef struct {
  double radius[3], volume, piola[3][3], factor[2][WIDTH];
  int count;
  double reflector[CONDITIONS][MOST_INNER], particular[CONDITIONS][WIDTH];
} element;

/* The Piola transform of symmetric tensors in Mandel components, from the edges of a cell. */
INLINE void set_piola(const double *a, const double *b, double size, double (*piola)[3])
{
  for (int i = 0; i < 2; ++i) {
    piola[i][0] = a[i] * a[i] / size;
    piola[i][1] = b[i] * b[i] / size;
    piola[i][2] = M_SQRT2 * a[i] * b[i] / size;
  }
  piola[2][0] = M_SQRT2 * a[0] * a[1] / size;
  piola[2][1] = M_SQRT2 * b[0] * b[1] / size;
  piola[2][2] = (a[0] * b[1] + a[1] * b[0]) / size;
}

/* What each input of the cell is on the reference cell: forces are mapped by the inverse Jacobian. */
INLINE void set_factors(const int k, const double (*inverse)[2], double (*factor)[WIDTH])
{
  const int m = facet_nodes(k), b = body_forces(k);
  for (int i = 0; i < 2; ++i) {
    double *to = factor[i];
    for (int j = 0; j < 3 * b; ++j)
      *to++ = -inverse[i][0];
    for (int j = 0; j < bubbles(k); ++j)
      *to++ = i == 0;
    for (int j = 0; j < 6 * m; ++j)
      *to++ = inverse[i][j % 2];
    for (int j = 0; j < b; ++j)
      *to++ = inverse[i][1];
  }
}

/* Row of component a of the stress at a place with such a table (3, 2, inputs, in whole blocks): its values for all inputs. */
INLINE void stress_row(const int k, const element *it, const double *table, int a, double *row)
{
  for (int j = 0; j < inputs(k); j += BLOCK) {
    block sum = {0};
    for (int s = 0; s < 3; ++s)
      for (int i = 0; i < 2; ++i)
        sum += it->piola[a][s] * CONST_BLOCK(it->factor[i] + j) * CONST_BLOCK(table + (2 * s + i) * in_blocks(inputs(k)) + j);
    AS_BLOCK(row + j) = sum;
  }
}

/* Balance of radial force, and of moment over the size of the cell about its middle. */
INLINE void set_conditions(const int k, const double *corners, double (*row)[WIDTH])
{
  const int m = facet_nodes(k), b = body_forces(k), first = inner(k), last = first + 6 * m;
  double about[3][2], middle[2] = {0}, size = 0.0;
  for (int i = 0; i < 6; ++i) {
    about[i / 2][i % 2] = corners[i] - corners[i % 2];
    middle[i % 2] += about[i / 2][i % 2] / 3;
  }
  for (int i = 0; i < 6; ++i) {
    about[i / 2][i % 2] -= middle[i % 2];
    size = fmax(size, fabs(about[i / 2][i % 2]));
  }
  memset(row, 0, 2 * sizeof(*row));
  for (int j = 0; j < 3 * b; ++j)
    row[0][j] = -1.0 / (3 * b);
  for (int f = 0; f < 3; ++f)
    for (int j = 0; j < m; ++j) {
      const double *one = about[f == 0 ? 1 : 0], *two = about[f == 2 ? 1 : 2];
      /* Mean of a linear function times the polynomial of a node. */
      const double share = k == 1 ? (j == 0 ? 2.0 / 6 : 1.0 / 6) : (j == 0 ? 3.0 : j == 1 ? 1.0 : 2.0) / 12;
      const int at = first + (f * m + j) * 2;
      row[0][at] = 1.0 / m;
      row[1][at] = -(share * one[1] + (1.0 / m - share) * two[1]) / size;
      row[1][at + 1] = (share * one[0] + (1.0 / m - share) * two[0]) / size;
    }
  for (int p = 0; p < 3; ++p) {
    double height[3], sum = 0.0;
    for (int v = 0; v < 3; ++v)
      sum += height[v] = v == p ? 0.0 : about[v][1];
    for (int j = 0; j < b; ++j)
      row[1][p * b + j] = (k == 1 ? sum / 3 : (height[j] + sum) / 12) / (3 * size);
  }
  for (int j = 0; j < b && k == 2; ++j)
    row[1][last + j] = about[j][0] / (12 * size);
}

/* Reflect the inner amounts of a row. */
INLINE void reflected(const int k, const double *v, double *row)
{
  block part = {0};
  /* Before the first amount and behind the last one v is zero. */
  for (int j = 0; j < in_blocks(inner(k)); j += BLOCK)
    part += CONST_BLOCK(row + j) * CONST_BLOCK(v + j);
  const double sum = total(part);
  for (int j = 0; j < in_blocks(inner(k)); j += BLOCK)
    AS_BLOCK(row + j) -= sum * CONST_BLOCK(v + j);
}

/* Reflections of the inner amounts after which the first ones alone meet the conditions, as functions of the other
   inputs. */
INLINE void set_balance(const int k, double (*row)[WIDTH], element *it)
{
  const int first = inner(k), w = inputs(k);
  for (int c = 0; c < it->count; ++c) {
    double *v = it->reflector[c], size = 0.0;
    memset(v, 0, sizeof(it->reflector[c]));
    for (int j = c; j < first; ++j) {
      v[j] = row[c][j];
      size += v[j] * v[j];
    }
    v[c] += v[c] < 0 ? -sqrt(size) : sqrt(size);
    double length = 0.0;
    for (int j = c; j < first; ++j)
      length += v[j] * v[j];
    /* As long as I - v v^T reflects. */
    for (int j = c; j < first; ++j)
      v[j] *= sqrt(2 / length);
    for (int other = c; other < it->count; ++other)
      reflected(k, v, row[other]);
    for (int j = first; j < w; ++j) {
      double sum = row[c][j];
      for (int i = 0; i < c; ++i)
        sum += row[c][i] * it->particular[i][j];
      it->particular[c][j] = -sum / row[c][c];
    }
  }
}

/* The element of a cell. Table at_middles (3, 3, 2, inputs) has the stress amid the edges. */
INLINE void set_element(const int k, const double *corners, const _Bool *on_axis, const double *at_middles,
                        element *it)
{
  const double *x = corners;
  const double a[2] = {x[2] - x[0], x[3] - x[1]}, b[2] = {x[4] - x[0], x[5] - x[1]};
  const double determinant = a[0] * b[1] - a[1] * b[0];
  const double inverse[2][2] = {{b[1] / determinant, -b[0] / determinant}, {-a[1] / determinant, a[0] / determinant}};
  double row[CONDITIONS][WIDTH] = {{0}};
  for (int v = 0; v < 3; ++v)
    it->radius[v] = x[2 * v];
  it->volume = fabs(determinant) / 2;
  set_piola(a, b, fabs(determinant), it->piola);
  set_factors(k, inverse, it->factor);
  set_conditions(k, corners, row);
  it->count = 2;
  if (k == 2 && on_axis[0] + on_axis[1] + on_axis[2] == 2) {
    const int facet = !on_axis[0] ? 0 : !on_axis[1] ? 1 : 2, w = inputs(k);
    double largest = 0.0;
    stress_row(k, it, at_middles + facet * 6 * in_blocks(w), 1, row[2]);
    for (int j = 0; j < inner(k); ++j)
      largest = fmax(largest, fabs(row[2][j]));
    for (int j = 0; j < w; ++j)
      row[2][j] /= largest;
    it->count = 3;
  }
  set_balance(k, row, it);
}
#endif
