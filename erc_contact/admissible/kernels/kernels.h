/* The kernels, each with the place of its meaning. Python reads these lines, too. Arrays are contiguous. Arguments
   edges, facets, side, area and volume are of CellGeometry; varies tells whether a compliance differs from cell to
   cell. What returns int returns -1 if there is too little memory. DIMENSION, d, is 2 or 3: each has a library of its
   own. */

/* Number of patches with rings of one size that are worked on side by side. */
int lane_count(void);

/* tighten/rings.py: the way along all rings; returns their number. mine (F, d) is lost. */
long long find_rings(long long pairs, const double *edges, const int *facets, const long long *side,
                     _Bool *mine, int *ring, int *size);

/* tighten/patches.py: the factors of all patches. unknown (F, d): components of facets whose traction is not given.
   turning (F): number of the rigid face that turns freely, 0 elsewhere; null without any. */
int factor_patches(long long patches, const int *ring, const int *size, const double *edges,
                   const int *facets, const long long *side, long long F, const _Bool *unknown, const int *turning,
                   const double *compliance, int varies, const double *table, int *factor, float *unit, double *scale);

/* tighten/patches.py: adds to z (F, m, d) the corrections for the residual r. */
int apply_patches(int m, long long patches, const int *ring, const int *size, const double *edges,
                  const long long *side, const int *factor, const float *unit, const double *scale, const double *r,
                  double *z);

/* tighten/complementary.py: returns the energy of the cells from this one on, and adds half its derivative to y. A sparse
   matrix is three arrays: start, column, value. */
double macro_energy(int m, long long begin, long long cells, const double *edges, const int *facets,
                    const long long *side, const double *compliance, int varies, int points, const double *facet_map, int Q,
                    const int *start, const int *column, const double *value, const int *back_start,
                    const int *back_column, const double *back_value, const int *weight_start,
                    const int *weight_column, const double *weight, int count, const double *bubbles,
                    const double *transposed, const double *products, int b, const double *elastic,
                    const double *of_mean, const int *elastic_start, const int *elastic_column,
                    const double *elastic_value, int forces, const double *force, const double *body,
                    const double *x, double *y);

/* tighten/complementary.py: the energies of the moments of the first cells, as matrices of 30 binary digits, lower
   triangles row by row, and the roots of their diagonals; some cells side by side. */
int energy_matrices(int m, long long cells, const double *edges, const int *facets, const long long *side,
                    const double *compliance, int varies, int points, int Q, int count, const double *functions,
                    const double *products, int *matrix, double *scale);

/* tighten/complementary.py: returns the energy of these cells, and adds half its derivative to y. */
double matrix_energy(int m, long long cells, const int *facets, const int *matrix, const double *scale,
                     const double *x, double *y);

/* tighten/complementary.py: adds to sigma (cells, nodes, s) the bubbles that bring it nearest to an elastic stress. */
void relax_stresses(int nodes, long long cells, const double *edges, const double *compliance, int varies,
                    int points, int Q, const int *row_start, const int *row_column, const double *row_value,
                    const int *weight_start, const int *weight_column, const double *weight, int count,
                    const double *nodal_bubbles, const double *bubbles, const double *transposed,
                    const double *products, int b, const double *elastic, const int *elastic_start,
                    const int *elastic_column, const double *elastic_value, double *sigma);

/* tighten/blocks.py: adds to matrices (F, j d, j d) the energies of the quadratic moments, and inverts them. */
void facet_blocks(long long cells, const double *edges, const int *facets, const double *compliance,
                  int varies, const double *table, long long F, const _Bool *free, const _Bool *mine,
                  double *matrices);

/* facets.py: replaces the right sides lambda (cells, N, d) of the patches of all nodes by their solutions. */
int patch_jumps(int N, int m, long long cells, long long nodes, long long F, const int *node,
                const int *facets, const long long *side, const int *on_facet, const double *weight,
                const _Bool *fixed, const _Bool *complete, int *start, int *member, int *place, double *lambda);

/* elastic.py: strains (cells, b, s) of a displacement u in Mandel components. */
void cell_strains(int N, int b, long long cells, const int *node, const double *area, const double *volume,
                  const double *slopes, const double *u, double *strain);

/* macro.py: sigma^ (cells, d+1, N, s) from the tractions and the body force of each cell. */
void macro_stresses(int N, int m, int b, long long cells, const double *edges, const double *stress,
                    const double *forces, const double *force, const double *map, const double *of_facets,
                    const double *of_subs, double *sigma);

/* imbalance.py: the greatest force that is missing in the equilibrium of a stress in each cell, and the greatest product
   of a stress and an area there. */
void unbalanced_stresses(int N, int m, int b, long long cells, const double *area, const double *stress,
                         const double *forces, const double *force, const int *between, const int *on_facet,
                         const int *common, double *missing, double *size);

/* error/bulk.py: |stress - elastic|^2 and |stress + elastic|^2 of each cell, at q points of each sub-simplex. The elastic
   stress is given there, or by b coefficients times of_elastic (subs q, b). */
void stress_squares(long long cells, int subs, int N, int q, const double *shape, const double *weight,
                    const double *volume, const double *stress, int b, const double *of_elastic,
                    const double *elastic, int varies, int points, const double *compliance, double *difference,
                    double *both);
