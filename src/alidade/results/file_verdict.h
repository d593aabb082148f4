#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "alidade/estimation/verdict.h"

namespace alidade {

/// The verdict of the run that made a file. Files of an estimate that is not good contain it, so that their readers
/// know.
struct FileVerdict {
  State state = State::good;
  std::string sentence;
  std::string cause;  ///< A fault that no σ of the file includes; empty: none.
};

/// Lines for the end of a YAML file; none for a good estimate.
[[nodiscard]] std::string file_verdict_text(const Verdict& verdict, const std::string& cause = "");
/// The verdict in the text of a file; none if there is none, or the text is not YAML.
[[nodiscard]] std::optional<FileVerdict> file_verdict(std::string_view text);

/// Adds the check "inputs" about a file that was read: an answer based on one that is not to be trusted is never good,
/// and one that only passes it on (`is_passed_on`), or uses its numbers with a cause that is in no σ, is no better than
/// it.
void heed_file(const std::string& file, const FileVerdict& told, bool is_passed_on, Verdict& verdict);

}  // namespace alidade
