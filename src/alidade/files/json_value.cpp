#include "alidade/files/json_value.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace alidade {
namespace {

using nlohmann::ordered_json;

ordered_json tree_of(const JsonValue& value);

struct ToTree {
  template <typename Plain>
  ordered_json operator()(const Plain& plain) const {
    return plain;
  }
  ordered_json operator()(const JsonValue::List& list) const {
    ordered_json tree = ordered_json::array();
    for (const JsonValue& each : list) tree.push_back(tree_of(each));
    return tree;
  }
  ordered_json operator()(const JsonValue::Object& object) const {
    ordered_json::object_t tree;
    for (const auto& [key, value] : object) tree.emplace_back(key, tree_of(value));  // keys are unique already
    return tree;
  }
};

ordered_json tree_of(const JsonValue& value) { return std::visit(ToTree{}, value.content()); }

}  // namespace

JsonValue JsonValue::object() {
  JsonValue value;
  value.content_ = Object{};
  return value;
}

JsonValue& JsonValue::operator[](std::string_view key) {
  if (std::holds_alternative<std::nullptr_t>(content_)) content_ = Object{};
  Object& members = std::get<Object>(content_);
  const auto found =
      std::find_if(members.begin(), members.end(), [&](const Member& each) { return each.first == key; });
  if (found != members.end()) return found->second;
  return members.emplace_back(std::string(key), JsonValue()).second;
}

void JsonValue::push_back(JsonValue value) {
  if (std::holds_alternative<std::nullptr_t>(content_)) content_ = List{};
  std::get<List>(content_).push_back(std::move(value));
}

std::string JsonValue::text(int indent) const {
  // File names need not be UTF-8; JSON must be.
  return tree_of(*this).dump(indent, ' ', false, ordered_json::error_handler_t::replace);
}

std::vector<double> rounded(std::vector<double> numbers, int decimals) {
  const double scale = std::pow(10.0, decimals);
  for (double& number : numbers) number = std::round(number * scale) / scale + 0.0;  // + 0: never "-0.0"
  return numbers;
}

}  // namespace alidade
