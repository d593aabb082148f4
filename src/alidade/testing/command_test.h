#pragma once

#include <gtest/gtest.h>

#include "alidade/testing/process.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade::testing {

/// Runs the executable in a child, with these words behind its name.
[[nodiscard]] inline Outcome run_alidade(std::vector<std::string> words) {
  words.insert(words.begin(), ALIDADE_EXECUTABLE);
  return run_program(std::move(words));
}

/// A test of commands: a folder of its own, and the executable.
class CommandTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  [[nodiscard]] static Outcome alidade(std::vector<std::string> words) { return run_alidade(std::move(words)); }
  /// The words, then the options.
  [[nodiscard]] static Outcome alidade(std::vector<std::string> words, const std::vector<std::string>& options) {
    words.insert(words.end(), options.begin(), options.end());
    return run_alidade(std::move(words));
  }

 private:
  TemporaryFolder folder_;
};

}  // namespace alidade::testing
