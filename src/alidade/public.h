#pragma once

/// Around what a public header declares: it is seen from outside the shared library. A pragma, since clang does not
/// carry an attribute of the namespace over to a function that is defined elsewhere.
#if defined(__GNUC__)
#define ALIDADE_PUBLIC_BEGIN _Pragma("GCC visibility push(default)")
#define ALIDADE_PUBLIC_END _Pragma("GCC visibility pop")
#else
#define ALIDADE_PUBLIC_BEGIN
#define ALIDADE_PUBLIC_END
#endif
