#include "cli/app/field_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "alidade/files/config_file.h"
#include "cli/app/run.h"

namespace alidade::cli {
namespace {

/// CLI11's own way to say that the value of an option is none.
void set_or_throw(const Field& field, const std::string& option, const std::string& text, bool is_first = true) {
  if (const std::string fault = set_field(field, text, is_first); !fault.empty()) {
    throw CLI::ValidationError(option, fault);
  }
}

CLI::Option* add_option(CLI::App& command, const Field& field, const std::string& name) {
  if (bool* const* flag = std::get_if<bool*>(&field.value)) return command.add_flag(name, **flag, field.help);
  if (std::holds_alternative<std::vector<std::string>*>(field.value)) {
    const auto take = [field, name](const std::vector<std::string>& parts) {
      for (std::size_t i = 0; i < parts.size(); ++i) set_or_throw(field, name, parts[i], i == 0);
    };
    return command.add_option_function<std::vector<std::string>>(name, take, field.help)->delimiter(',');
  }
  if (const auto* code = std::get_if<TextCode>(&field.value); code && code->num_parts != 1) {
    const auto take = [field, name](const std::vector<std::string>& parts) {
      set_or_throw(field, name, fmt::format("{}", fmt::join(parts, ",")));
    };
    CLI::Option* option = command.add_option_function<std::vector<std::string>>(name, take, field.help);
    return code->num_parts == 0 ? option : option->delimiter(',')->expected(code->num_parts);
  }
  return command.add_option_function<std::string>(
      name, [field, name](const std::string& text) { set_or_throw(field, name, text); }, field.help);
}

bool is_typed(const CLI::App& command, const Field& field) {
  const auto count = [&](const std::string& option) { return command.count(option) > 0; };
  return count(option_of(field)) || std::any_of(field.old_options.begin(), field.old_options.end(), count);
}

/// An option by two of its names: which of both values is meant is not guessed.
void require_one_name(const CLI::App& command, const Field& field) {
  std::vector<std::string> typed;
  for (const std::string& old : field.old_options)
    if (command.count(old) > 0) typed.push_back(old);
  if (command.count(option_of(field)) > 0) typed.push_back(option_of(field));
  if (typed.size() < 2) return;
  throw UsageError(fmt::format("{}: {} are names of one option, {}: give it once", command.get_name(),
                               fmt::join(typed, " and "), option_of(field)));
}

}  // namespace

void add_fields(CLI::App& command, const FieldList& fields) {
  for (const Field& field : fields) {
    const std::string default_text = std::holds_alternative<bool*>(field.value) ? "" : value_text(field);
    CLI::Option* option = add_option(command, field, option_of(field));
    option->group(field.group.empty() ? option->get_group() : field.group);
    if (!std::holds_alternative<bool*>(field.value))
      option->type_name(form_text(field) + (field.is_required ? " REQUIRED" : ""));
    if (!field.is_required && !default_text.empty()) option->default_str(default_text);
    for (const std::string& old : field.old_options) add_option(command, field, old)->group("");
  }
}

void take_config(const CLI::App& command, const FieldList& fields, const std::filesystem::path& file) {
  for (const Field& field : fields) require_one_name(command, field);
  std::vector<std::string> in_file;
  if (!file.empty()) in_file = read_config(file, fields, [&](const Field& field) { return is_typed(command, field); });
  for (const Field& field : fields) {
    if (!field.is_required || is_typed(command, field)) continue;
    if (std::find(in_file.begin(), in_file.end(), field.name) != in_file.end()) continue;
    std::string name = command.get_name();
    throw UsageError(name + ": " + option_of(field) + " is required; see alidade " + name + " --help");
  }
}

}  // namespace alidade::cli
