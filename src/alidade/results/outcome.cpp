#include "alidade/results/outcome.h"

#include <fmt/format.h>

#include <algorithm>

#include "alidade/results/file_verdict.h"

namespace alidade {

void note_verdict(std::initializer_list<std::string_view> files, JobOutcome& outcome, const std::string& cause) {
  const std::string note = file_verdict_text(outcome.document.verdict, cause);
  for (NamedBytes& file : outcome.files)
    if (std::ranges::count(files, file.name) > 0) file.bytes += note;
}

void add_each(std::string_view kind, std::span<const std::string> each, std::vector<std::string>& lines) {
  constexpr std::size_t most_lines = 10;
  for (const std::string& what : each.first(std::min(most_lines, each.size())))
    lines.push_back(fmt::format("{}: {}", kind, what));
  if (each.size() > most_lines)
    lines.push_back(fmt::format("{}: {} more, named in result.json", kind, each.size() - most_lines));
}

}  // namespace alidade
