// Which way the paths of a body are found.
#include "render/optical_path.h"

const char *const alb_optical_kind_names[ALB_OPTICAL_KINDS] = {"convex", "solid", "sheet"};
