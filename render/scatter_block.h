// Links as they are found, and how they are laid down for the products.
#pragma once
#include "render/scatter_links.h"

enum { ALB_OCTAVES = ALB_KERNEL_BINS / 4, ALB_BUCKETS = ALB_SIDES * ALB_OCTAVES * ALB_LINK_KINDS };

typedef struct alb_found_link {
    uint32_t source; // node or leaf
    uint16_t bucket; // (side, octave, kind)
    int8_t direction[4];
    size_t codes; // where they begin
} alb_found_link;

// Of one block, in the order of the sources. Grown with alb_grow.
typedef struct alb_found_links {
    alb_found_link *links;
    uint32_t *order;
    uint8_t *codes;
    alb_exact_pair *pairs;
    size_t count, capacity, code_count, code_capacity, pair_count, pair_capacity, order_capacity;
    bool failed; // for want of memory
} alb_found_links;

// The items with room for so many more; failed, and as they were, for want of memory.
void *alb_grow(bool *failed, void *items, size_t *capacity, size_t count, size_t more, size_t size);
void alb_found_links_free(alb_found_links *found);
// Allocates what the block holds. kernels: by side.
void alb_link_block_write(alb_link_block *block, alb_found_links *found, const uint16_t kernels[ALB_SIDES]);
