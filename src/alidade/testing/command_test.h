#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "alidade/testing/process.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade::testing {

/// Runs the executable in a child, with these words behind its name.
[[nodiscard]] inline Outcome run_alidade(std::vector<std::string> words) {
  words.insert(words.begin(), ALIDADE_EXECUTABLE);
  return run_program(std::move(words));
}

/// Copies what results stand in a folder to where the test `schema` looks at them all, by the test's name.
inline void keep_results(const std::filesystem::path& folder) {
  const std::filesystem::path kept = ALIDADE_KEPT_RESULTS;
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  std::error_code ignored;
  std::filesystem::create_directories(kept, ignored);
  int number = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder, ignored)) {
    if (entry.path().filename() != "result.json" || !entry.is_regular_file(ignored)) continue;
    const std::string name = std::string(test->test_suite_name()) + "." + test->name() + "." + std::to_string(number++);
    std::filesystem::copy_file(entry.path(), kept / (name + ".json"), std::filesystem::copy_options::overwrite_existing,
                               ignored);
  }
}

/// A test of commands: a folder of its own, and the executable.
class CommandTest : public ::testing::Test {
 public:
  ~CommandTest() override { keep_results(folder_.path()); }

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
