#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace alidade::cli {

/// This program's own file.
[[nodiscard]] std::filesystem::path own_executable();

struct ChildResult {
  int exit_code = 0;   ///< 128 + the signal that ended it.
  std::string errors;  ///< The end of what it wrote on stderr.
  bool is_stopped = false;
};

/// Runs a program to its end, with nothing on stdin and its stdout lost. `goes_on` is asked now and then; where it says
/// no, the program is ended. Throws InputError where it cannot be started.
[[nodiscard]] ChildResult run_child(const std::filesystem::path& program, const std::vector<std::string>& words,
                                    const std::function<bool()>& goes_on);

}  // namespace alidade::cli
