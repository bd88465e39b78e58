/* The way along the rings of facets, see tighten/rings.py. */
#include "kernels.h"
#include "rings.h"

/* Whether these nodes of a cell are oriented as the space is. */
INLINE int oriented(const int d, const double *edges, const int *node)
{
  int turns = 0;
  for (int a = 0; a < d; ++a)
    for (int b = a + 1; b <= d; ++b)
      turns += node[a] > node[b];
  const double *x = edges, *y = edges + d, *z = edges + 2 * d;
  const double determinant = d == 2 ? x[0] * y[1] - x[1] * y[0]
                                    : x[0] * (y[1] * z[2] - y[2] * z[1]) + x[1] * (y[2] * z[0] - y[0] * z[2])
                                          + x[2] * (y[0] * z[1] - y[1] * z[0]);
  return (determinant > 0) == (turns % 2 == 0);
}

/* The pair of the next facet of a ring (on = 1) or of the one before (on = 0), -1 at the end. */
INLINE long long neighbour(const int d, long long pairs, const double *edges, const int *facets,
                           const long long *side, long long pair, int on, int *code)
{
  const long long facet = pair / d, F = pairs / d;
  int node[4];
  long long place = side[facet];
  in_order(d, place % (d + 1), pair % d, node);
  const int first = oriented(d, edges + place / (d + 1) * d * d, node);
  *code = 2 * (int)pair + first;
  if (first != on) {
    if (side[F + facet] == place)
      return -1;
    place = side[F + facet];
    in_order(d, place % (d + 1), pair % d, node);
  }
  const int f = node[d], apex = node[d - 1];
  return (long long)facets[place / (d + 1) * (d + 1) + apex] * d + (f < apex ? f : f - 1);
}

INLINE long long rings(const int d, long long pairs, const double *edges, const int *facets, const long long *side,
                       _Bool *mine, int *ring, int *size)
{
  long long found = 0;
  int code;
  for (long long pair = 0; pair < pairs; ++pair) {
    if (!mine[pair])
      continue;
    long long begin = pair, next;
    while ((next = neighbour(d, pairs, edges, facets, side, begin, 0, &code)) >= 0 && next != pair)
      begin = next;
    size[found] = 0;
    next = begin;
    do {
      const long long here = next;
      mine[here] = 0;
      next = neighbour(d, pairs, edges, facets, side, here, 1, &code);
      *ring++ = code;
      ++size[found];
    } while (next >= 0 && next != begin);
    ++found;
  }
  return found;
}

long long find_rings(long long pairs, const double *edges, const int *facets, const long long *side,
                     _Bool *mine, int *ring, int *size)
{
  return rings(DIMENSION, pairs, edges, facets, side, mine, ring, size);
}

int lane_count(void) { return LANES; }
