#include "cli/commands/localize_epoch.h"

#include <fmt/format.h>

#include <algorithm>

#include "alidade/tables/localize_file.h"

namespace alidade::cli {

void from_epoch(std::int64_t origin_ns, std::vector<TimedPose>& truth) {
  const double origin_s = 1e-9 * static_cast<double>(origin_ns);
  if (truth.empty() || truth.back().t_s < 0.5 * origin_s) return;
  for (TimedPose& pose : truth) pose.t_s -= origin_s;
}

void to_epoch(std::int64_t origin_ns, const Localization& result, JobOutcome& outcome) {
  const auto file = std::ranges::find(outcome.files, "trajectory.tum", &NamedBytes::name);
  if (origin_ns == 0 || file == outcome.files.end()) return;
  const double origin_s = 1e-9 * static_cast<double>(origin_ns);
  std::vector<TimedPose> path;
  for (const PathStep& step : result.path)
    if (step.has_pose()) path.push_back({origin_s + step.t_s, step.world_from_cam});
  file->bytes = tum_text(path);
  outcome.lines.push_back(fmt::format(
      "t_s is after {:.9f} s, the first image's time in data.csv; trajectory.tum has the times of data.csv", origin_s));
}

}  // namespace alidade::cli
