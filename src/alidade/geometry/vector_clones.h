#pragma once

#include "alidade/geometry/sanitizers.h"

/// Marks a hot loop that is compiled twice, for any x86-64 and for AVX with FMA, and chosen when the program starts:
/// speed without asking users for -march=native. The choice is by feature: "fma" would exclude every
/// processor that is not Intel's. Sanitizers cannot start with such functions.
/// For functions of an unnamed namespace: clang 14 miscalls them from other files. No constructors in them: clang
/// forgets to make what only they call.
#if defined(__x86_64__) && !ALIDADE_IS_SANITIZED
#define ALIDADE_VECTOR_CLONES __attribute__((target_clones("default", "fma")))
#else
#define ALIDADE_VECTOR_CLONES
#endif

/// Before a loop: no number that it writes is read by another iteration.
#ifdef __clang__
#define ALIDADE_NO_ALIASES _Pragma("clang loop vectorize(assume_safety)")
#else
#define ALIDADE_NO_ALIASES _Pragma("GCC ivdep")
#endif
