#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "alidade/estimation/verdict.h"

namespace alidade {

/// What the run that made a file said of its answer. The files of an answer that is not good carry it, so that what
/// reads them knows.
struct FileVerdict {
  State state = State::good;
  std::string sentence;
  std::string cause;  ///< What is wrong and in no σ of the file; empty: nothing is.
};

/// Lines for the end of a YAML file; none for an answer that is good.
[[nodiscard]] std::string file_verdict_text(const Verdict& verdict, const std::string& cause = "");
/// What the text of a file says of it; none where it says nothing, or is not YAML.
[[nodiscard]] std::optional<FileVerdict> file_verdict(std::string_view text);

/// Adds the check "inputs" about a file that was read: of an answer that is not to be trusted no answer is good, and
/// one that only passes it on (`is_passed_on`), or takes its numbers with a cause that is in no σ, is no better than
/// it.
void heed_file(const std::string& file, const FileVerdict& told, bool is_passed_on, Verdict& verdict);

}  // namespace alidade
