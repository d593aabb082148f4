#pragma once

#include <string>
#include <string_view>

namespace alidade::report {

/// Text made harmless in HTML text and quoted attributes: & < > " ' escaped, control characters and broken UTF-8
/// replaced.
[[nodiscard]] std::string escaped(std::string_view text);

[[nodiscard]] std::string base64(std::string_view bytes);

/// JSON made harmless inside <script>: every `<` becomes `\u003c`.
[[nodiscard]] std::string json_in_script(std::string_view json);

/// A number to so many significant digits without needless exponents; "–" where missing.
[[nodiscard]] std::string number_text(double value, int digits = 4);

/// The same with its closing zeros, for columns of numbers: "0.200".
[[nodiscard]] std::string rounded_text(double value, int digits);

/// "532.8 ± 1.3": value and 3σ to two digits of 3σ; without a usable σ the value to 4 digits, and nothing behind it.
struct ValueText {
  std::string value, plus_minus;
};
[[nodiscard]] ValueText value_text(double value, double sigma);

}  // namespace alidade::report
