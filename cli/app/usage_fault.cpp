#include "cli/app/usage_fault.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

namespace alidade::cli {
namespace {

/// Inserted, removed or replaced letters, and swapped neighbours, between two words. Damerau 1964.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before, above, row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    before = std::exchange(above, row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = above[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({replaced, above[j] + 1, row[j - 1] + 1});
      const bool is_swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (is_swapped) row[j] = std::min(row[j], before[j - 2] + 1);
    }
  }
  return row.back();
}

/// "; did you mean 'WORD'?" for the nearest of the known words, if one is near: one typo in three letters, dashes
/// aside.
std::string suggestion(const std::string& word, const std::vector<std::string>& known) {
  const std::string* nearest = nullptr;
  const std::size_t num_letters = word.size() - std::min(word.find_first_not_of('-'), word.size());
  std::size_t distance = (num_letters + 1) / 3;
  for (const std::string& each : known) {
    const std::size_t d = edit_distance(word, each);
    if (d > distance || (nearest != nullptr && d == distance)) continue;
    nearest = &each;
    distance = d;
  }
  return nearest != nullptr ? "; did you mean '" + *nearest + "'?" : "";
}

std::vector<std::string> subcommand_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* each : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(each->get_name());
  return names;
}

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* each : app.get_options()) {
    for (const std::string& name : each->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

/// The command, or group, that the line got to.
const CLI::App& deepest(const CLI::App& app) {
  const auto parsed = app.get_subcommands();
  return parsed.empty() ? app : deepest(*parsed.front());
}

/// "camera show: " of the app that the line got to; "" of the program itself.
std::string where(const CLI::App& app) {
  if (app.get_parent() == nullptr) return "";
  const std::string parent = where(*app.get_parent());
  return (parent.empty() ? "" : parent.substr(0, parent.size() - 2) + " ") + app.get_name() + ": ";
}

bool is_option(const std::string& word) { return word.size() > 1 && word.front() == '-'; }

std::string name_of(const std::string& option) { return option.substr(0, option.find('=')); }

/// Whether the command, or one of the group, has the option.
bool knows(const CLI::App& app, const std::string& option) {
  if (app.get_option_no_throw(option) != nullptr) return true;
  const auto commands = app.get_subcommands([](const CLI::App*) { return true; });
  return std::any_of(commands.begin(), commands.end(), [&](const CLI::App* each) { return knows(*each, option); });
}

/// An option of the command (`at`) that was typed before it: "--json" of "alidade --json calibrate". None: "".
std::string early_option(const CLI::App& app, const CLI::App& at) {
  if (!subcommand_names(app).empty()) {
    for (const std::string& word : app.remaining()) {
      if (!is_option(word)) break;  // a command, though an unknown one
      if (knows(at, name_of(word))) return name_of(word);
    }
  }
  const auto parsed = app.get_subcommands();
  return parsed.empty() ? "" : early_option(*parsed.front(), at);
}

/// "'--size' needs a value: WxH": an option that the line ends with, or that another follows. "'--size' is given more
/// than once".
std::string missing_value(const CLI::App& at, const CLI::ParseError& error) {
  const std::string what = error.what(), name = what.substr(0, what.find(':'));
  const CLI::Option* option = at.get_option_no_throw(name);
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) == nullptr || option == nullptr) return "";
  const auto most = static_cast<std::size_t>(option->get_items_expected_max());
  if (option->results().size() > most) return "'" + name + "' is given more than once";
  const int count = option->get_items_expected_min();
  const std::string type = option->get_type_name();
  return "'" + name + "' needs " + (count == 1 ? "a value" : std::to_string(count) + " values") + ": " +
         type.substr(0, std::min(type.find(" REQUIRED"), type.find(':')));
}

}  // namespace

std::string usage_fault(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App& at = deepest(app);
  if (const std::string early = early_option(app, at); !early.empty()) {
    const std::string command = where(at).substr(0, where(at).find(':'));
    return "'" + early + "' comes after the command: alidade " + command + (command.empty() ? "" : " ") +
           (subcommand_names(at).empty() ? "" : "COMMAND ") + early + " …";
  }
  const std::vector<std::string> names = subcommand_names(at);
  std::string extra;
  for (const std::string& word : app.remaining(true)) {
    // An unknown option explains more than its effects; an unknown command explains its options.
    if (extra.empty() || (names.empty() && extra.front() != '-' && word.front() == '-')) extra = word;
  }
  if (is_option(extra)) {
    return where(at) + "unknown option '" + name_of(extra) + "'" + suggestion(name_of(extra), option_names(at));
  }
  if (!extra.empty() && !names.empty()) {
    return where(at) + "unknown command '" + extra + "'" + suggestion(extra, names);
  }
  if (at.get_parent() == nullptr) return "a command is required; see alidade --help";
  if (!names.empty()) {
    std::string list;
    for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
    return where(at) + "a command is required: " + list + "; see alidade " + at.get_name() + " --help";
  }
  const std::string in_help = "; see alidade " + where(at).substr(0, where(at).size() - 2) + " --help";
  if (!extra.empty()) return where(at) + "unexpected argument '" + extra + "'";
  if (const std::string missing = missing_value(at, error); !missing.empty()) return where(at) + missing;
  const bool is_missing = dynamic_cast<const CLI::RequiredError*>(&error) != nullptr;
  return where(at) + error.what() + (is_missing ? in_help : "");
}

bool names_unknown_command(const CLI::App& app) {
  if (subcommand_names(deepest(app)).empty()) return false;
  const std::vector<std::string> words = app.remaining(true);
  return std::ranges::any_of(words, [](const std::string& word) { return !is_option(word); });
}

bool lacks_a_number(std::string_view word) {
  if (const std::size_t value = word.find('='); word.substr(0, 1) == "-" && value != std::string_view::npos)
    word.remove_prefix(value + 1);
  const bool is_list = word.find(',') != std::string_view::npos &&
                       word.find_first_of("0123456789") != std::string_view::npos &&
                       word.find_first_not_of("0123456789.,+-eE ") == std::string_view::npos;
  return is_list && (word.front() == ',' || word.back() == ',' || word.find(",,") != std::string_view::npos);
}

}  // namespace alidade::cli
