#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace alidade::cli {

/// What an option takes, for people: "NUMBER 0..10", "N 1..20", "auto|drop|keep"; from CLI11's type and checks.
[[nodiscard]] std::string words_of_type(const std::string& type_and_checks);

/// Help texts: what an option takes in words, its default, what it goes with.
class HelpFormat : public CLI::Formatter {
 public:
  std::string make_option_name(const CLI::Option* option, bool is_positional) const override;
  std::string make_option_opts(const CLI::Option* option) const override;
};

/// Command lines, one per line, indented; lines that do not begin with `alidade` as they are.
[[nodiscard]] std::string indented_examples(const std::string& examples);

}  // namespace alidade::cli
