#pragma once

/// Marks a hot loop that is compiled twice, for any x86-64 and for AVX with FMA, and chosen when the program starts:
/// speed without asking users for -march=native. The choice is by feature: "fma" would leave out every
/// processor that is not Intel's. Sanitizers cannot start with such functions.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define ALIDADE_VECTOR_CLONES __attribute__((target_clones("default", "fma")))
#else
#define ALIDADE_VECTOR_CLONES
#endif
