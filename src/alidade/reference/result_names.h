#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace alidade {

/// One name of a result: its position, what it is, what it means.
struct ResultName {
  std::string path;     ///< "camera.fx", "photos[].file", "controllers.*.rms_px"; [3]: a list of three.
  std::string kind;     ///< Unit of a number (px, m, rad, 1 …), or: count, text, flag, any.
  std::string meaning;  ///< One line, without a stop.
};

/// Names in the document that a command leaves, and in the files beside it.
struct ResultNames {
  std::vector<ResultName> estimate;  ///< Also those of σ, in `stddev` and `stddev_model`.
  std::vector<ResultName> data;      ///< Tables: "corners.u_px".
  std::vector<ResultName> grids;     ///< "sigma_map.sigma_px".
  std::vector<ResultName> files;     ///< Columns: "corners.csv.u_px"; a file that is no table: "camera.yaml".
};

/// Every command that leaves a result: "calibrate", "plan observe".
[[nodiscard]] std::vector<std::string> commands_with_results();

/// Of one of these commands; throws std::out_of_range for another.
[[nodiscard]] ResultNames result_names(const std::string& command);

/// Reads "NAME  KIND  MEANING" lines in parts headed by "estimate:", "data:", "grids:", "files:". A line that ends a
/// name with a dot takes all lines below that are indented into it.
[[nodiscard]] ResultNames parse_result_names(std::string_view text);

}  // namespace alidade
