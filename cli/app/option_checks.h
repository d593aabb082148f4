#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <string>

namespace alidade::cli {

/// A finite number: an option's own conversion takes nan, inf and 1e999.
[[nodiscard]] inline CLI::Validator finite_number() {
  return {[](const std::string& text) -> std::string {
            double value = 0.0;
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
            const bool is_number = error == std::errc{} && end == text.data() + text.size() && std::isfinite(value);
            return is_number ? "" : "'" + text + "' is not a finite number";
          },
          "NUMBER"};
}

/// A finite number above zero.
[[nodiscard]] inline CLI::Validator positive_number() {
  return {[](const std::string& text) -> std::string {
            const std::string fault = finite_number()(text);
            if (!fault.empty()) return fault;
            return std::stod(text) > 0.0 ? "" : "'" + text + "' is not above zero";
          },
          "NUMBER > 0"};
}

}  // namespace alidade::cli
