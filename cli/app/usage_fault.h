#pragma once

#include <string>
#include <string_view>

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace alidade::cli {

/// What is wrong with a command line that could not be parsed, in one line that says what to do.
[[nodiscard]] std::string usage_fault(const CLI::App& app, const CLI::ParseError& error);

/// Whether a word where a command belongs is none, as of "help calibrat".
[[nodiscard]] bool names_unknown_command(const CLI::App& app);

/// Whether it is a list of numbers of which one is missing, as `1,,2`: the parser would pass over it, and the others
/// would be another's.
[[nodiscard]] bool lacks_a_number(std::string_view word);

}  // namespace alidade::cli
