// Zeroed memory with the multiplication checked. Release with free().
#pragma once
#include "base/error.h"
#include <stddef.h>

// count * size zeroed bytes (at least one); NULL with ALB_NO_MEMORY in error.
void *alb_allocate(size_t count, size_t size, alb_error *error);
