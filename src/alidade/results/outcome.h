#pragma once

#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/public.h"
#include "alidade/results/result_document.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A file beside result.json, or an image (JPEG) of the report.
struct NamedBytes {
  std::string name;
  std::string bytes;
};

/// Everything that a job produces: what a command shows and writes, and what a program saves.
struct JobOutcome {
  ResultDocument document;         ///< Of it counts, assumed, verdict, estimate … grids; the rest is the run's.
  std::vector<std::string> lines;  ///< For display, before the verdict.
  std::vector<NamedBytes> files;
  std::vector<NamedBytes> images;  ///< The most wanted first.
};

/// These files of the outcome say, where its verdict is not good, that it is not, and what is in no σ of them.
void note_verdict(std::initializer_list<std::string_view> files, JobOutcome& outcome, const std::string& cause = "");

/// "KIND: WHAT", a line for each; of many the first ten, and how many more result.json names.
void add_each(std::string_view kind, std::span<const std::string> each, std::vector<std::string>& lines);

/// Rows of the job's file that were wrong and not read: counted as given, and named.
inline void add_skipped(const std::vector<SkippedInput>& skipped, JobOutcome& outcome) {
  add_skipped(skipped, outcome.document.counts);
}

ALIDADE_PUBLIC_END
}  // namespace alidade
