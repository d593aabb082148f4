#include "alidade/localize/path_doubt.h"

namespace alidade {

bool PathDoubt::is_wrong_after(const PathStep& step) {
  if (step.num_tracked + step.num_gated == 0) return false;
  constexpr std::size_t window = 5;
  constexpr double most_nis = 2.0, most_gated = 0.6;
  recent_nis_.push_back(step.num_tracked > 0 ? step.nis_per_dof : most_nis);
  const double gated_now = static_cast<double>(step.num_gated) / static_cast<double>(step.num_tracked + step.num_gated);
  const double known_gated =
      step.num_known > 0 ? static_cast<double>(step.num_known_gated) / static_cast<double>(step.num_known) : 0.0;
  constexpr double more_of_known = 0.25;  // four known points, two of them mismatched, are no proof
  recent_gated_.push_back(std::max(gated_now, known_gated - more_of_known));
  if (recent_nis_.size() > window) {
    recent_nis_.pop_front();
    recent_gated_.pop_front();
  }
  if (recent_nis_.size() < window) return false;
  double nis = 0.0, gated = 0.0;
  for (std::size_t i = 0; i < window; ++i) {
    nis += recent_nis_[i] / window;
    gated += recent_gated_[i] / window;
  }
  return nis > most_nis || gated > most_gated;
}

void PathDoubt::clear() {
  recent_nis_.clear();
  recent_gated_.clear();
}

}  // namespace alidade
