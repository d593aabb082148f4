#pragma once

#include <string>
#include <string_view>

namespace alidade {

/// SHA-256 as 64 hexadecimal digits: says which input a result was made from. NIST FIPS 180-4.
[[nodiscard]] std::string sha256(std::string_view bytes);

}  // namespace alidade
