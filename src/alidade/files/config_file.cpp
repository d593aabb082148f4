#include "alidade/files/config_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>

#include "alidade/files/yaml_fields.h"

namespace alidade {
namespace {

/// The option's name is the one that is known from help: "square", "image-noise" or "image_noise" beside "square_m".
bool names(const std::string& key, const Field& field) {
  if (key == field.name) return true;
  std::string dashed = "--" + key;
  std::replace(dashed.begin(), dashed.end(), '_', '-');
  const std::vector<std::string>& old = field.old_options;
  return dashed == option_of(field) || std::find(old.begin(), old.end(), dashed) != old.end();
}

void take_value(const Field& field, const std::string& key, const YAML::Node& node, const std::string& file) {
  const auto take = [&](const YAML::Node& value, bool is_first) {
    if (!value.IsScalar()) detail::refuse(file, key, "is not one value");
    if (const std::string fault = set_field(field, value.Scalar(), is_first); !fault.empty()) {
      detail::refuse(file, key, fault);
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
  std::vector<std::string> known, in_file;
  for (const Field& field : fields) known.push_back(field.name);
  for (const std::string& key : map.keys()) {
    const auto named =
        std::find_if(fields.begin(), fields.end(), [&](const Field& field) { return names(key, field); });
    if (named == fields.end()) {
      detail::refuse(name, key, fmt::format("is not a key of this command; known: {}", fmt::join(known, " ")));
    }
    if (std::find(in_file.begin(), in_file.end(), named->name) != in_file.end()) {
      detail::refuse(name, key, "says what another key says: " + named->name + " is given twice");
    }
    in_file.push_back(named->name);
    if (!is_typed(*named)) take_value(*named, key, root[key], name);
  }
  return in_file;
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
