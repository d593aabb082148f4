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

/// A file next to result.json, or an image (JPEG) of the report.
struct NamedBytes {
  std::string name;
  std::string bytes;
};

/// Everything that a job produces: what a command prints and writes, and what a program saves.
struct JobOutcome {
  ResultDocument document;         ///< Only counts, assumed, verdict, estimate … grids; the run sets the rest.
  std::vector<std::string> lines;  ///< For display, before the verdict.
  std::vector<NamedBytes> files;
  std::vector<NamedBytes> images;  ///< The most important first.
};

/// If the verdict is not good, appends a note to these files that says so, and which errors σ does not include.
void note_verdict(std::initializer_list<std::string_view> files, JobOutcome& outcome, const std::string& cause = "");

/// One line "KIND: WHAT" for each; of more than ten the first ten, and how many more result.json names.
void add_each(std::string_view kind, std::span<const std::string> each, std::vector<std::string>& lines);

/// Adds wrong rows of the job's input file that were not read: they count as given, and are listed.
inline void add_skipped(const std::vector<SkippedInput>& skipped, JobOutcome& outcome) {
  add_skipped(skipped, outcome.document.counts);
}

ALIDADE_PUBLIC_END
}  // namespace alidade
