#include <algorithm>
#include <cmath>
#include <string>

#include "alidade/localize/checks/judge.h"

namespace alidade {
namespace {

constexpr double ordinary_focal = 0.003, ordinary_centre_px = 2.0, ordinary_scale = 0.002, ordinary_clock_s = 0.001;
constexpr const char* remedy_camera = "use a camera file with its covariance (alidade calibrate writes one)";

struct Named {
  std::string_view given;
  const char* name;
  double ordinary;
};
constexpr std::array<Named, 5> all_named{{{"focal length", "camera.f (relative)", ordinary_focal},
                                          {"centre u", "camera.cx", ordinary_centre_px},
                                          {"centre v", "camera.cy", ordinary_centre_px},
                                          {"scale of the target", "target.scale", ordinary_scale},
                                          {"clock", "times (s)", ordinary_clock_s}}};

double value_of(std::string_view given, const Camera& camera) {
  const Eigen::VectorXd lens = params(camera.lens);
  if (given == "scale of the target") return 1.0;
  if (given == "clock") return 0.0;
  return given == "centre u" ? lens[2] : given == "centre v" ? lens[3] : lens[0];
}

}  // namespace

std::vector<Assumption> localize_assumed(const Localization& report) {
  std::vector<Assumption> assumed;
  if (!std::ranges::any_of(report.path, &PathStep::has_pose)) return assumed;
  for (const GivenNumber& given : report.given) {
    const auto named = std::ranges::find(all_named, given.name, &Named::given);
    if (named == all_named.end()) continue;
    const bool is_scale = named->given == "scale of the target", is_clock = named->given == "clock";
    if ((is_scale || is_clock) && !report.scale_known) continue;
    Assumption each;
    each.name = named->name;
    each.value = value_of(named->given, report.camera);
    each.sigma = is_scale && !report.is_scale_given ? std::nullopt : given.sigma;
    each.ordinary = named->ordinary;
    const double error = each.sigma.value_or(named->ordinary);
    each.moves = given.moves * error;
    each.moved = std::string(given.moved);
    each.moved_by = given.moved_by * error;
    each.remedy = is_scale   ? "give --sigma-scale, or σ in --target: sigma_m of each point, sigma_square_m of a board"
                  : is_clock ? "take times at the centre of each exposure: no observation says when it was"
                             : remedy_camera;
    assumed.push_back(each);
  }
  return assumed;
}

}  // namespace alidade
