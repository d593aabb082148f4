#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "alidade/report/figures.h"

namespace alidade::report {

/// State, sentence, what to add, counts and checks; checks link to those figures that are there.
[[nodiscard]] std::string page_header(const Document& document, const std::vector<Figure>& figures);

[[nodiscard]] std::string card(const Figure& figure);

/// Version, command line, inputs with SHA-256, time, seed, seconds, what was skipped.
[[nodiscard]] std::string provenance(const Document& document);

/// Looks: light and dark, screen and paper. A few lines of script: theme, choice of a photo, downloads.
[[nodiscard]] std::string page_style();
[[nodiscard]] std::string_view page_script();

}  // namespace alidade::report
