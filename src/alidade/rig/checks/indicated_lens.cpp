#include "alidade/rig/checks/indicated_lens.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace alidade {
namespace {

bool is_single(const RigCause& cause) { return cause.name.starts_with("head"); }

int head_of(const RigCause& cause) { return std::stoi(cause.name.substr(4)); }

/// "fx", "cx", "k1".
std::string param_of(const RigCause& cause) { return cause.name.substr(cause.name.rfind('.') + 1); }

/// Those of single lenses that a cause is of, or, of all, consists of.
std::vector<RigCause> singles_of(const RigReport& report, const RigCause& cause) {
  if (is_single(cause)) return {cause};
  std::vector<RigCause> singles;
  for (const RigCause& one : report.causes) {
    const bool is_of_centre = param_of(one) == "cx" || param_of(one) == "cy";
    if (is_single(one) && one.is_of_lens() &&
        (cause.name == "all centre" ? is_of_centre : cause.name.ends_with(param_of(one))))
      singles.push_back(one);
  }
  return singles;
}

bool correct(const RigCause& cause, Camera& camera) {
  if (cause.is_distortion()) camera = with_distortion(camera);
  const std::vector<std::string> names = param_names(camera.lens);
  const auto found = std::ranges::find(names, param_of(cause));
  if (found == names.end()) return false;
  Eigen::VectorXd values = params(camera.lens);
  const auto at = found - names.begin();
  const double factor = (values[at] + cause.size) / values[at];
  if (param_of(cause) == "fx") values[1] *= factor;  // both by one factor
  values[at] += cause.size;
  camera.lens = with_params(camera.lens, values);
  return true;
}

}  // namespace

bool indicates_lens(const RigReport& report) {
  return !report.causes.empty() && report.causes.front().is_of_lens() && report.causes.front().sigmas > rig_cause_limit;
}

std::optional<std::map<int, Camera>> with_indicated_lens(const std::map<int, Camera>& cameras,
                                                         const RigReport& report) {
  if (!indicates_lens(report)) return std::nullopt;
  std::map<int, Camera> corrected = cameras;
  for (const RigCause& cause : singles_of(report, report.causes.front()))
    if (!correct(cause, corrected.at(head_of(cause)))) return std::nullopt;
  return corrected;
}

}  // namespace alidade
