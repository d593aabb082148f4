#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <functional>
#include <string>

namespace alidade::cli {

/// `fault`: of a number that is finite; an option's own conversion takes nan, inf and 1e999.
[[nodiscard]] inline CLI::Validator checked_number(std::function<std::string(double)> fault, std::string description) {
  return {[fault = std::move(fault)](const std::string& text) -> std::string {
            double value = 0.0;
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
            const bool is_number = error == std::errc{} && end == text.data() + text.size() && std::isfinite(value);
            const std::string found = is_number ? fault(value) : "is not a finite number";
            return found.empty() ? "" : "'" + text + "' " + found;
          },
          std::move(description)};
}

[[nodiscard]] inline CLI::Validator finite_number() {
  return checked_number([](double) { return std::string(); }, "NUMBER");
}

/// A finite number above zero.
[[nodiscard]] inline CLI::Validator positive_number() {
  return checked_number([](double value) { return value > 0.0 ? "" : "is not above zero"; }, "NUMBER > 0");
}

/// A finite number from `low` to `high`.
[[nodiscard]] inline CLI::Validator number_within(double low, double high) {
  const auto fault = [low, high](double value) {
    return value >= low && value <= high ? "" : fmt::format("is not within {:g} to {:g}", low, high);
  };
  return checked_number(fault, fmt::format("NUMBER in [{:g} - {:g}]", low, high));
}

/// An option with a number of such limits; its default is shown.
inline CLI::Option* add_number(CLI::App& command, const char* name, double& value, const char* help, double low,
                               double high) {
  return command.add_option(name, value, help)->check(number_within(low, high))->capture_default_str();
}

}  // namespace alidade::cli
