#pragma once

#include <string>
#include <string_view>

namespace alidade {

/// SHA-256 as 64 hexadecimal digits: identifies the input of a result. NIST FIPS 180-4.
[[nodiscard]] std::string sha256(std::string_view bytes);

}  // namespace alidade
