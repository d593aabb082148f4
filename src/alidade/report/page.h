#pragma once

#include <map>
#include <string>
#include <string_view>

namespace alidade {

/// The self-contained report page (one HTML file, opens offline) of a result document.
/// `result_json`: the document of `result.json` (schema alidade-result/1); the page draws its `data` and `grids` and
/// computes nothing that could be wrong. `images`: file name as in the document → JPEG bytes.
/// A figure without its table is omitted, and the page says so. In a build without the page of web/ it is plain_page.
[[nodiscard]] std::string report_page(std::string_view result_json, const std::map<std::string, std::string>& images);

}  // namespace alidade
