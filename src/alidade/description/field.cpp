#include "alidade/description/field.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

namespace alidade {
namespace {

template <typename... Cases>
struct Overloaded : Cases... {
  using Cases::operator()...;
};
template <typename... Cases>
Overloaded(Cases...) -> Overloaded<Cases...>;

template <typename Number>
std::optional<Number> number_of(const std::string& text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  if (!std::isfinite(static_cast<double>(value))) return std::nullopt;
  return value;
}

bool is_within(double value, const Limits& limits) {
  return value <= limits.max && (limits.is_above_min ? value > limits.min : value >= limits.min);
}

/// "above 0", "within 0 to 10", "at least 1".
std::string limits_text(const Limits& limits) {
  if (limits.is_above_min && std::isinf(limits.max)) return fmt::format("above {:g}", limits.min);
  if (std::isinf(limits.max)) return fmt::format("at least {:g}", limits.min);
  if (std::isinf(limits.min)) return fmt::format("at most {:g}", limits.max);
  return fmt::format("{}within {:g} to {:g}", limits.is_above_min ? fmt::format("above {:g} and ", limits.min) : "",
                     limits.min, limits.max);
}

std::string quoted(const std::string& text) { return "'" + text + "'"; }

template <typename Number>
std::string set_number(const std::string& text, const Limits& limits, const char* what, Number& value) {
  const auto number = number_of<Number>(text);
  if (!number) return quoted(text) + " is not " + what;
  if (!is_within(static_cast<double>(*number), limits)) return quoted(text) + " is not " + limits_text(limits);
  value = *number;
  return "";
}

std::string set_flag(const std::string& text, bool& value) {
  if (text != "true" && text != "false") return quoted(text) + " is not true or false";
  value = text == "true";
  return "";
}

}  // namespace

std::string option_of(const Field& field) {
  if (!field.option.empty()) return field.option;
  static constexpr std::array<std::string_view, 9> units = {"_m_s2", "_px", "_deg", "_rad", "_hz",
                                                            "_s",    "_m",  "_mm",  "_ms"};
  std::string name = field.name;
  for (const std::string_view unit : units) {
    if (!name.ends_with(unit)) continue;
    name.resize(name.size() - unit.size());
    break;
  }
  std::ranges::replace(name, '_', '-');
  return "--" + name;
}

std::string set_field(const Field& field, const std::string& text, bool is_first) {
  return std::visit(Overloaded{[&](bool* value) { return set_flag(text, *value); },
                               [&](int* value) { return set_number(text, field.limits, "a whole number", *value); },
                               [&](double* value) { return set_number(text, field.limits, "a finite number", *value); },
                               [&](std::optional<double>* value) {
                                 double number = 0.0;
                                 std::string fault = set_number(text, field.limits, "a finite number", number);
                                 if (fault.empty()) *value = number;
                                 return fault;
                               },
                               [&](std::string* value) {
                                 *value = text;
                                 return std::string();
                               },
                               [&](std::vector<std::string>* value) {
                                 if (is_first) value->clear();
                                 value->push_back(text);
                                 return std::string();
                               },
                               [&](const TextCode& code) { return code.read(text); }},
                    field.value);
}

std::string value_text(const Field& field) {
  return std::visit(
      Overloaded{[](const bool* value) { return std::string(*value ? "true" : "false"); },
                 [](const int* value) { return fmt::format("{}", *value); },
                 [](const double* value) { return fmt::format("{}", *value); },
                 [](const std::optional<double>* value) { return *value ? fmt::format("{}", **value) : std::string(); },
                 [](const std::string* value) { return *value; },
                 [](const std::vector<std::string>* value) { return fmt::format("{}", fmt::join(*value, ",")); },
                 [](const TextCode& code) { return code.write(); }},
      field.value);
}

std::string form_text(const Field& field) {
  const auto number = [&](const std::string& kind) {
    constexpr double max_shown = 1e5;  // beyond it the limit is there for the machine alone
    const Limits& limits = field.limits;
    if (limits.max <= max_shown) return fmt::format("{} {:g}..{:g}", kind, limits.min, limits.max);
    if (limits.is_above_min) return fmt::format("{} > {:g}", kind, limits.min);
    return kind;
  };
  if (!field.form.empty()) return field.form;
  return std::visit(Overloaded{[](const bool*) { return std::string(); }, [&](const int*) { return number("N"); },
                               [&](const double*) { return number("NUMBER"); },
                               [&](const std::optional<double>*) { return number("NUMBER"); },
                               [](const std::string*) { return std::string("TEXT"); },
                               [](const std::vector<std::string>*) { return std::string("NAME,..."); },
                               [](const TextCode& code) { return fmt::format("{}", fmt::join(code.words, "|")); }},
                    field.value);
}

std::vector<std::string> faults_of(const FieldList& fields) {
  std::vector<std::string> found;
  for (const Field& field : fields) {
    double value = 0.0;
    if (const auto* number = std::get_if<double*>(&field.value)) {
      value = **number;
    } else if (const auto* count = std::get_if<int*>(&field.value)) {
      value = **count;
    } else if (const auto* some = std::get_if<std::optional<double>*>(&field.value); some && **some) {
      value = ***some;
    } else {
      continue;
    }
    if (!std::isfinite(value)) {
      found.push_back(fmt::format("{} is not a finite number", field.name));
    } else if (!is_within(value, field.limits)) {
      found.push_back(fmt::format("{} is {:g}, not {}", field.name, value, limits_text(field.limits)));
    }
  }
  return found;
}

TextCode length_code(double& value_m, double min_m, double max_m) {
  TextCode code;
  code.read = [&value_m, min_m, max_m](const std::string& text) -> std::string {
    double value = 0.0;
    const char* const end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data(), end, value);
    const std::string_view unit(rest, static_cast<std::size_t>(end - rest));
    if (error != std::errc{} || !std::isfinite(value)) return quoted(text) + " is not a finite number";
    const double metres = unit == "mm" ? 1e-3 : unit == "cm" ? 1e-2 : unit == "m" || unit.empty() ? 1.0 : 0.0;
    if (metres == 0.0) return quoted(text) + " is not a finite number";
    if (!(value > 0.0)) return quoted(text) + " is not above zero";
    if (unit.empty() && value > max_m) {
      return fmt::format("'{0}' would be {0} m: give metres, {1:g}, or a unit, {0}mm or {0}m", text, 1e-3 * value);
    }
    if (unit.empty() && value < min_m) {
      return fmt::format("'{}' is in metres, {:g} mm: if that is meant, with its unit, {:g}mm", text, 1e3 * value,
                         1e3 * value);
    }
    value_m = value * metres;
    return "";
  };
  code.write = [&value_m] { return value_m > 0.0 ? fmt::format("{}", value_m) : std::string(); };
  return code;
}

TextCode pair_code(int& first, int& second, int max, const std::string& example, int min) {
  TextCode code;
  code.read = [&first, &second, max, min, example](const std::string& text) -> std::string {
    constexpr std::string_view sign = "×";  // as sentences write it
    const bool is_sign = text.find(sign) != std::string::npos;
    const std::size_t cross = is_sign ? text.find(sign) : text.find_first_of("xX");
    const auto a = number_of<int>(text.substr(0, cross));
    const auto b =
        cross == std::string::npos ? std::nullopt : number_of<int>(text.substr(cross + (is_sign ? sign.size() : 1)));
    if (!a || !b || *a < min || *b < min || *a > max || *b > max) return quoted(text) + " is not " + example;
    first = *a;
    second = *b;
    return "";
  };
  code.write = [&first, &second] { return first > 0 ? fmt::format("{}x{}", first, second) : std::string(); };
  return code;
}

TextCode numbers_code(int count, const std::function<std::vector<double>()>& values,
                      const std::function<void(const std::vector<double>&)>& take) {
  TextCode code;
  code.num_parts = count;
  code.read = [count, take](const std::string& text) -> std::string {
    std::vector<double> numbers;
    for (std::size_t begin = 0; begin <= text.size();) {
      const std::size_t end = std::min(text.find(',', begin), text.size());
      const auto number = number_of<double>(text.substr(begin, end - begin));
      if (!number) return quoted(text.substr(begin, end - begin)) + " is not a finite number";
      numbers.push_back(*number);
      begin = end + 1;
    }
    if (numbers.size() != static_cast<std::size_t>(count)) {
      return fmt::format("'{}' is {} number{}, not {}", text, numbers.size(), numbers.size() == 1 ? "" : "s", count);
    }
    take(numbers);
    return "";
  };
  code.write = [values] { return fmt::format("{}", fmt::join(values(), ",")); };
  return code;
}

}  // namespace alidade
