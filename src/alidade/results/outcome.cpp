#include "alidade/results/outcome.h"

#include <algorithm>

#include "alidade/results/file_verdict.h"

namespace alidade {

void note_verdict(std::initializer_list<std::string_view> files, JobOutcome& outcome) {
  const std::string note = file_verdict_text(outcome.document.verdict);
  for (NamedBytes& file : outcome.files)
    if (std::ranges::count(files, file.name) > 0) file.bytes += note;
}

}  // namespace alidade
