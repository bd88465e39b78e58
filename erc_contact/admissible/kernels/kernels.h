/* The kernels. Python reads these lines, too. Arrays are C-contiguous, their shapes are in the callers' docstrings. */

long long find_rings(int d, long long pairs, const double *edges, const int *facets, const long long *side,
                     _Bool *mine, int *ring, int *size);

int factor_patches(int d, long long patches, const int *ring, const int *size, const double *edges,
                   const int *facets, const long long *side, long long F, const _Bool *unknown, const double *compliance, int varies,
                   const double *table, int *factor, float *unit, double *scale);

int apply_patches(int d, int m, long long patches, const int *ring, const int *size, const double *edges,
                  const long long *side, const int *factor, const float *unit, const double *scale, const double *r, double *z);

double macro_energy(int d, int m, long long begin, long long end, const double *edges, const int *facets,
                    const long long *side, const double *compliance, int varies, int points,
                    const double *facet_map, int Q, const int *start, const int *column, const double *value,
                    const int *back_start, const int *back_column, const double *back_value,
                    const int *weight_start, const int *weight_column, const double *weight, int count,
                    const double *bubbles, const double *products, const double *x, const double *mean,
                    const double *offset, double *y);

int patch_jumps(int d, int N, int m, long long cells, long long nodes, long long F, const int *node,
                const int *facets, const long long *side, const int *on_facet, const double *weight,
                const _Bool *fixed, const _Bool *complete, int *start, int *member, int *place, double *lambda);

void stress_squares(long long cells, int s, int subs, int N, int q, const double *shape, const double *weight,
                    const double *volume, const double *stress, int elastic_points, const double *elastic,
                    int varies, int points, const double *compliance, double *difference, double *both);

void cell_strains(int d, int N, int b, long long cells, const int *node, const double *area, const double *volume,
                  const double *slopes, const double *u, double *strain);

void macro_stresses(int d, int N, int m, int b, long long cells, const double *edges, const double *stress,
                    const double *forces, const double *force, const double *map, const double *of_facets,
                    const double *of_subs, double *sigma);
