// A binary heap in an array of the caller's: the least key first, of equal keys the least id, so that the order in
// which entries were pushed does not matter.
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct alb_heap_entry {
    double key;
    uint32_t id;
} alb_heap_entry;

typedef struct alb_heap {
    alb_heap_entry *entries; // the least first
    size_t count, capacity;
} alb_heap;

static inline bool alb_heap_less(alb_heap_entry a, alb_heap_entry b)
{
    return a.key < b.key || (a.key == b.key && a.id < b.id);
}

// False where the heap is full: it then stays as it is.
static inline bool alb_heap_push(alb_heap *heap, double key, uint32_t id)
{
    const alb_heap_entry entry = {key, id};
    alb_heap_entry *entries = heap->entries;
    if (heap->count == heap->capacity)
        return false;
    size_t at = heap->count++;
    for (; at > 0 && alb_heap_less(entry, entries[(at - 1) / 2]); at = (at - 1) / 2)
        entries[at] = entries[(at - 1) / 2];
    entries[at] = entry;
    return true;
}

// Takes the least entry; there is one.
static inline alb_heap_entry alb_heap_pop(alb_heap *heap)
{
    alb_heap_entry *entries = heap->entries;
    const alb_heap_entry top = entries[0], last = entries[--heap->count];
    size_t at = 0;
    for (size_t child; (child = 2 * at + 1) < heap->count; at = child) {
        if (child + 1 < heap->count && alb_heap_less(entries[child + 1], entries[child]))
            child++;
        if (!alb_heap_less(entries[child], last))
            break;
        entries[at] = entries[child];
    }
    entries[at] = last;
    return top;
}
