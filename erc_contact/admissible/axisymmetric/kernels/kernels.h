/* The kernels, each with the place of its meaning. Python reads these lines, too. Arrays are contiguous; k is the degree,
   1 or 2; corners (n, 3, 2) and on_axis (n, 3) are of the sorted vertices of cells; facets and side are of CellGeometry.
   A compliance or stiffness (4, 4) has strides by cell and by point, 0 where it does not vary. What returns int returns
   -1 if there is too little memory. */

/* axisymmetric/elements.py: energies of the cells at P points, with the inner amounts eliminated. */
void ring_energies(int k, long long cells, long long owned, const double *corners, const _Bool *on_axis,
                   const double *at_middles, int P, const double *at_points, const double *places,
                   const double *weight, const double *hoop, long long by_cell, long long by_point,
                   const double *compliance, const double *force, const double *elastic, double *matrix,
                   double *slope, double *least, double *upper);

/* axisymmetric/elements.py: stresses (owned, 3, N, 4) from forces x (owned, 3, m, 2) and those amounts. */
void ring_stresses(int k, long long owned, const double *corners, const _Bool *on_axis, const double *at_middles,
                   const double *at_nodes, const double *hoop, const double *force, const double *upper,
                   const double *x, double *stress);

/* axisymmetric/missing.py: the greatest missing force of cells, and the greatest force of their stresses. */
void ring_missing(int k, long long owned, const double *corners, const _Bool *on_axis, const double *area,
                  const int *on_facet, const int *common, const int *ends, const double *gradient,
                  const double *hoop, const double *on_pieces, const double *force, const double *forces,
                  const double *stress, double *missing, double *size);

/* axisymmetric/tighten.py: returns x.A x + 2 g.x of the cells' forces, and adds half its derivative to y (F, m, 2). */
double ring_energy(int k, long long owned, const int *facets, const long long *side, const double *matrix,
                   const double *slope, const double *x, double *y);

/* axisymmetric/tighten.py: factors of the patches, one after the other. A facet has the basis bases[kind];
   flows tells which patches have a flux. */
int ring_patches(int m, long long patches, const int *ring, const int *size, const int *facets,
                 const long long *side, long long F, const int *kind, const double *bases,
                 const _Bool *flows, const double *matrix, double *factor);

/* axisymmetric/tighten.py: adds to z (F, m, 2) the corrections of the patches for the residual r. */
int ring_corrections(int m, long long patches, const int *ring, const int *size, const int *kind,
                     const double *bases, const _Bool *flows, const double *factor, const double *r, double *z);

/* error/rings.py: |S - C eps|^2 and |S + C eps|^2 of some pieces, by a rule with q points in barycentric coordinates;
   number is 3 cell + piece. */
void ring_squares(int k, long long count, const long long *number, const double *corners, const double *volume,
                  int q, const double *points, const double *weight, long long by_cell,
                  const double *stiffness, const double *compliance, const double *stress,
                  const double *strain, const double *radial, double *square);
