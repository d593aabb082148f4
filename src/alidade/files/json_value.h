#pragma once

#include <concepts>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A JSON value built from plain C++ values: `value["camera"]["fx"] = 532.8`. Objects keep the order of insertion.
/// Numbers that are not finite become null in the text.
class JsonValue {
 public:
  using Member = std::pair<std::string, JsonValue>;
  using List = std::vector<JsonValue>;
  /// A separate type: libstdc++ 12 treats a variant of its own types as one that always holds a value, and if a copy
  /// runs out of memory it would destroy an object that was never constructed.
  struct Object : std::vector<Member> {
    using std::vector<Member>::vector;
  };
  using Content = std::variant<std::nullptr_t, bool, std::int64_t, double, std::string, std::vector<std::int64_t>,
                               std::vector<double>, List, Object>;

  JsonValue() = default;
  JsonValue(const char* text) : content_(std::string(text)) {}
  JsonValue(std::string_view text) : content_(std::string(text)) {}
  JsonValue(std::string text) : content_(std::move(text)) {}
  JsonValue(bool value) : content_(value) {}
  JsonValue(List list) : content_(std::move(list)) {}
  JsonValue(std::vector<double> numbers) : content_(std::move(numbers)) {}
  template <std::integral Integer>
  JsonValue(Integer value) : content_(static_cast<std::int64_t>(value)) {}
  template <std::floating_point Real>
  JsonValue(Real value) : content_(static_cast<double>(value)) {}
  template <std::integral Integer>
  JsonValue(const std::vector<Integer>& numbers)
      : content_(std::vector<std::int64_t>(numbers.begin(), numbers.end())) {}
  JsonValue(const std::vector<bool>& flags) : content_(List(flags.begin(), flags.end())) {}
  JsonValue(const std::vector<std::string>& texts) : content_(List(texts.begin(), texts.end())) {}

  /// An object without members, "{}"; a default-constructed JsonValue is null.
  [[nodiscard]] static JsonValue object();
  [[nodiscard]] static JsonValue list() { return JsonValue(List{}); }

  /// The member with that name, which is created if it does not exist. A null becomes an object.
  JsonValue& operator[](std::string_view key);
  /// Appends to a list. A null becomes a list.
  void push_back(JsonValue value);
  [[nodiscard]] const Content& content() const { return content_; }

  /// Text of the value. `indent` < 0: on one line.
  [[nodiscard]] std::string text(int indent = -1) const;

 private:
  Content content_ = nullptr;
};

/// The value in a column for a row without a value; it becomes null in a document.
inline constexpr double missing_value = std::numeric_limits<double>::quiet_NaN();

/// The numbers rounded to `decimals` decimals: what a reader can use, in a file of reasonable size.
[[nodiscard]] std::vector<double> rounded(std::vector<double> numbers, int decimals);

ALIDADE_PUBLIC_END
}  // namespace alidade
