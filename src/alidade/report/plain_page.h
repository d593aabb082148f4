#pragma once

#include <string>
#include <string_view>

namespace alidade::report {

/// The report where the library was built without the page of web/: the sentence, what to add, checks,
/// the estimate with ± 3σ (and what 3σ would be if all errors were independent), the assumptions, and the
/// first rows of each table; no figures, no script.
[[nodiscard]] std::string plain_page(std::string_view result_json);

}  // namespace alidade::report
