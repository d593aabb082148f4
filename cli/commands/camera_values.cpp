#include "cli/commands/camera_values.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/formats/camera_file.h"
#include "alidade/formats/rig_file.h"
#include "alidade/report/markup.h"

namespace alidade::cli {

void add_camera_input(Run& run, const std::filesystem::path& file) {
  const std::string name = file.string();
  run.add_input("camera", name, read_file(file_of_camera(file)));
  if (const std::string doubt = lens_doubt(file); !doubt.empty())
    run.add_doubt(name + ": " + doubt, "say which lens it is: " + name + ":fisheye, or " + name + ":brown");
}

void add_rig_input(Run& run, const std::filesystem::path& file) {
  run.add_input("rig", file);
  for (const std::filesystem::path& camera : camera_files_of_rig(file)) add_camera_input(run, camera);
}

void add_rig_doubts(Run& run, const Rig& rig) {
  for (const std::string& doubt : rig.doubts) run.add_doubt(doubt, rig_doubts_remedy);
}

Camera read_camera_input(Run& run, const std::filesystem::path& file) {
  Camera camera = read_camera(file);
  add_camera_input(run, file);
  return camera;
}

std::vector<std::string> camera_lines(const Camera& camera) {
  const std::vector<std::string> names = param_names(camera.lens);
  const Eigen::VectorXd values = params(camera.lens);
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Eigen::Index at = static_cast<Eigen::Index>(i);
    const double sigma = has_covariance(camera) ? std::sqrt(std::max(0.0, camera.cov(at, at))) : 0.0;
    const report::ValueText text = report::value_text(values[at], sigma);
    const std::string value =
        text.plus_minus.empty() ? fmt::format("{:.10g}", values[at]) : text.value + " ± " + text.plus_minus;
    const std::string name = names[i] + (names[i].size() < 5 ? "" : " ");
    lines.push_back(fmt::format("  {:<5}{}{}", name, value, i < 5 ? " px" : names[i].ends_with("_m") ? " m" : ""));
  }
  return lines;
}

}  // namespace alidade::cli
