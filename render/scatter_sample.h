// Where the light that patches send out comes from, by samples: the scattering of clusters (radiosity_clusters.h).
#pragma once
#include "render/scatter_links.h"

// sources[first[p] .. first[p + 1]), for each patch p: patches whose light leaves from p, each as often as its share of
// what even light of the channel sends out there, at equal steps through the local part and then the links.
// totals[patch]: row sums of S'; local[patch]: their parts from the patch itself. Patches in no tree have themselves.
// ALB_NO_MEMORY, sources then untouched.
bool alb_links_sample(uint32_t *sources, const uint32_t *first, int channel, const alb_links *links,
                      const alb_forest *forest, const alb_scatter_kernel *kernels, const double (*totals)[3],
                      const double (*local)[3], size_t patch_count, alb_error *error);
