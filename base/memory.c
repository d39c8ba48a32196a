// calloc with the multiplication checked. Half of SIZE_MAX is as much as any object may take.
#include "base/memory.h"
#include <stdint.h>
#include <stdlib.h>

void *alb_allocate(size_t count, size_t size, alb_error *error)
{
    if (size && count > SIZE_MAX / 2 / size) {
        alb_fail(error, ALB_NO_MEMORY, "cannot allocate %zu x %zu bytes", count, size);
        return NULL;
    }
    void *memory = calloc(count ? count : 1, size ? size : 1);
    if (!memory)
        alb_fail(error, ALB_NO_MEMORY, "out of memory: %zu x %zu bytes", count, size);
    return memory;
}
