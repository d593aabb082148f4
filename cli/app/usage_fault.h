#pragma once

#include <string>

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace alidade::cli {

/// What is wrong with a command line that could not be parsed, in one line that says what to do.
[[nodiscard]] std::string usage_fault(const CLI::App& app, const CLI::ParseError& error);

}  // namespace alidade::cli
