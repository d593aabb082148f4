#include "alidade/files/config_file.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>

#include "alidade/files/yaml_fields.h"

namespace alidade {
namespace {

void take_value(const Field& field, const YAML::Node& node, const std::string& file) {
  const auto take = [&](const YAML::Node& value, bool is_first) {
    if (!value.IsScalar()) detail::refuse(file, field.name, "is not one value");
    if (const std::string fault = set_field(field, value.Scalar(), is_first); !fault.empty()) {
      detail::refuse(file, field.name, fault);
    }
  };
  if (const auto* code = std::get_if<TextCode>(&field.value); code && code->num_parts != 1 && node.IsSequence()) {
    std::string text;
    for (const YAML::Node& part : node) text += (text.empty() ? "" : ",") + (part.IsScalar() ? part.Scalar() : "");
    return take(YAML::Node(text), true);
  }
  const bool is_list = std::holds_alternative<std::vector<std::string>*>(field.value);
  if (!is_list || !node.IsSequence()) return take(node, true);
  for (std::size_t i = 0; i < node.size(); ++i) take(node[i], i == 0);
}

}  // namespace

std::vector<std::string> read_config(const std::filesystem::path& file, const FieldList& fields,
                                     const std::function<bool(const Field&)>& is_typed) {
  const std::string name = file.string();
  const YAML::Node root = detail::load_yaml(read_file(file), name);
  const detail::Fields map(root, name);
  std::vector<std::string> known;
  for (const Field& field : fields) known.push_back(field.name);
  detail::refuse_unknown_keys(map, known, "this command");
  for (const Field& field : fields) {
    if (map.has(field.name) && !is_typed(field)) take_value(field, root[field.name], name);
  }
  return map.keys();
}

std::string config_text(const FieldList& fields) {
  std::string text;
  for (const Field& field : fields) {
    const bool is_list = std::holds_alternative<std::vector<std::string>*>(field.value);
    const std::string value = value_text(field);
    text += fmt::format("# {}{}\n{}{}: {}\n", field.help, form_text(field).empty() ? "" : " (" + form_text(field) + ")",
                        value.empty() ? "# " : "", field.name, is_list ? "[" + value + "]" : value);
  }
  return text;
}

}  // namespace alidade
