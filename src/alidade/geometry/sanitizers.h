#pragma once

/// 1 with the address or the thread sanitizer: g++ has a macro for each, clang a feature.
#if defined(__has_feature)
#define ALIDADE_HAS_FEATURE(what) __has_feature(what)
#else
#define ALIDADE_HAS_FEATURE(what) 0
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || ALIDADE_HAS_FEATURE(address_sanitizer) || \
    ALIDADE_HAS_FEATURE(thread_sanitizer)
#define ALIDADE_IS_SANITIZED 1
#else
#define ALIDADE_IS_SANITIZED 0
#endif
