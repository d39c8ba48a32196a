// Loops worth compiling twice: for every x86-64 and for those with AVX2, chosen when the program starts. The same
// operations in the same order (no contraction, no reassociation): the same bytes.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define ALB_VECTOR_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define ALB_VECTOR_CLONES
#endif
