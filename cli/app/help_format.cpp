#include "cli/app/help_format.h"

#include <algorithm>
#include <sstream>

namespace alidade::cli {
namespace {

/// " 0..10" of "FLOAT in [0 - 10]"; "" without a range, or where its end is there for the machine alone.
std::string range_of(const std::string& checks) {
  const std::size_t open = checks.find("in ["), dash = checks.find(" - ", open), close = checks.find(']', dash);
  if (close == std::string::npos) return "";
  const std::string least = checks.substr(open + 4, dash - open - 4), most = checks.substr(dash + 3, close - dash - 3);
  constexpr double max_meant = 1e5;
  if (std::stod(most) > max_meant) return "";
  return " " + least + ".." + most;
}

}  // namespace

std::string words_of_type(const std::string& type_and_checks) {
  // A value's own form may have colons: HEAD:HEAD:M.
  std::size_t colon = type_and_checks.find(':');
  const auto is_check = [&](const std::string& rest) {
    return rest.starts_with('{') || rest.starts_with("NUMBER") || rest.find("in [") != std::string::npos;
  };
  while (colon != std::string::npos && !is_check(type_and_checks.substr(colon + 1)))
    colon = type_and_checks.find(':', colon + 1);
  std::string type = type_and_checks.substr(0, colon);
  const std::string checks = colon == std::string::npos ? "" : type_and_checks.substr(colon + 1);
  if (checks.starts_with('{')) {
    std::string choices = checks.substr(1, checks.find('}') - 1);
    std::ranges::replace(choices, ',', '|');
    return choices;
  }
  if (type == "FLOAT") type = "NUMBER";
  if (type == "INT" || type == "UINT") type = "N";
  return type + range_of(checks) + (checks.find("> 0") != std::string::npos ? " > 0" : "");
}

std::string HelpFormat::make_option_name(const CLI::Option* option, bool is_positional) const {
  std::string name = CLI::Formatter::make_option_name(option, is_positional);
  const std::size_t value = name.find("{false}");  // of a flag that turns something off
  return value == std::string::npos ? name : name.erase(value, std::string_view("{false}").size());
}

std::string HelpFormat::make_option_opts(const CLI::Option* option) const {
  std::string text;
  if (option->get_type_size() != 0) {
    if (!option->get_type_name().empty()) text += " " + words_of_type(option->get_type_name());
    const bool says_list = text.find("...") != std::string::npos;
    if (!says_list && option->get_expected_max() == CLI::detail::expected_max_vector_size)
      text += " ...";
    else if (option->get_expected_min() > 1)
      text += " x " + std::to_string(option->get_expected());
    if (!option->get_default_str().empty()) text += " (default " + option->get_default_str() + ")";
    if (option->get_required() && !text.ends_with(" REQUIRED")) text += " REQUIRED";  // a field says it in its form
  }
  for (const CLI::Option* other : option->get_needs()) text += " with " + other->get_name();
  return text;
}

std::string indented_examples(const std::string& examples) {
  std::istringstream lines(examples);
  std::string line, text;
  while (std::getline(lines, line)) {
    const std::size_t first = std::min(line.find_first_not_of(' '), line.size());
    text += (line.compare(first, 8, "alidade ") == 0 ? "  " + line.substr(first) : line) + "\n";
  }
  return text;
}

}  // namespace alidade::cli
