/* Rings of facets, see tighten/rings.py, and what acts on their facets, see tighten/patches.py.

   A step of a ring is a number 2 p + q. The pair p = d * facet + j is the facet in the ring of the centre that is
   opposite to its node j; q = 1 if the first cell of the facet is the next one in the ring, 0 if the second one is. */
#ifndef RINGS_H
#define RINGS_H

#include "lanes.h"

/* Local nodes of a cell in the order of a ring from its facet f, whose node j is not on the centre: the nodes of the
   centre, node j of the facet, and the node that is not on the facet. */
INLINE void in_order(const int d, int f, int j, int *node)
{
  const int apex = j < f ? j : j + 1;
  int at = 0;
  for (int v = 0; v <= d; ++v)
    if (v != f && v != apex)
      node[at++] = v;
  node[d - 1] = apex;
  node[d] = f;
}

/* What acts on a facet of a ring: the couple, normal times weight of each node, and bars along its edges. All unknowns
   are forces: the couple is a moment over a length, and the bars are edges over it. */
typedef struct {
  lanes normal[3], weight[3], bar[3][3], sense;
} actions;

static const int ENDS[3][2] = {{0, 1}, {0, 2}, {1, 2}};

/* Edges from the first node of the centre: to its second node (in 3D), and to the node that is not on it. */
INLINE actions acting(const int d, const lanes *base, const lanes *apex, lanes sense, lanes length)
{
  actions it = {.sense = sense};
  lanes height[3], size, share = {0};
  memcpy(height, apex, d * sizeof(lanes));
  if (d == 3) {
    share = dot(3, apex, base) / dot(3, base, base);
    for (int i = 0; i < 3; ++i)
      height[i] -= share * base[i];
  }
  size = root(dot(d, height, height));
  across(d, d == 2 ? height : base, height, it.normal);
  const lanes turn = -sense / root(dot(d, it.normal, it.normal));
  for (int i = 0; i < d; ++i)
    it.normal[i] *= turn;
  it.weight[d - 1] = length / size;
  it.weight[0] = (share - 1.0) * it.weight[d - 1];
  if (d == 3)
    it.weight[1] = -share * it.weight[2];
  const lanes none[3] = {{0}}, *nodes[3] = {none, d == 3 ? base : apex, apex};
  for (int t = 0; t < d * (d - 1) / 2; ++t)
    for (int i = 0; i < d; ++i)
      it.bar[t][i] = (nodes[ENDS[t][1]][i] - nodes[ENDS[t][0]][i]) / length;
  return it;
}

/* Edges of a cell from its node[0] to the next nodes. */
INLINE void gather_edges(const int d, int count, const double *edges, const int *node, int lane, lanes (*x)[3])
{
  static const double zero[3] = {0, 0, 0};
  const double *from = node[0] ? edges + d * (node[0] - 1) : zero;
  for (int v = 1; v <= count; ++v)
    for (int i = 0; i < d; ++i)
      x[v - 1][i][lane] = (node[v] ? edges[d * (node[v] - 1) + i] : 0.0) - from[i];
}

/* How many patches from this one on have rings of its size, at most LANES. */
INLINE int alike(long long left, const int *size)
{
  int count = 1;
  while (count < LANES && count < left && size[count] == size[0])
    ++count;
  return count;
}
#endif
