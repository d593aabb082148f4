#pragma once

/// Stands before the name of the namespace of public headers: what they declare is seen from outside the shared
/// library.
#if defined(__GNUC__)
#define ALIDADE_PUBLIC [[gnu::visibility("default")]]
#else
#define ALIDADE_PUBLIC
#endif
