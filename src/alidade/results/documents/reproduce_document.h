#pragma once

#include <string>
#include <utility>
#include <vector>

#include "alidade/reproduce/paper_report.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// Fills counts, `estimate.claims`, the tables `experiments`, `methods` and `figures`, and fig_ID for each figure.
void fill_reproduction(const reproduce::PaperReport& report, ResultDocument& document);

/// The data of every figure as CSV: file name and content; claims.csv first.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> reproduction_csvs(const reproduce::PaperReport& report);

}  // namespace alidade
