#include <algorithm>
#include <cmath>
#include <string>

#include "alidade/localize/localize.h"

namespace alidade {
namespace {

constexpr double ordinary_focal = 0.003, ordinary_centre_px = 2.0, ordinary_scale = 0.002;
constexpr const char* remedy_camera = "use a camera file with its covariance (alidade calibrate writes one)";

/// Without a smoothed path: a focal length off by a share is a distance off by it, a centre off is a turn.
std::vector<GivenNumber> roughly_given(const LocalizeReport& report) {
  Eigen::Vector3d target = Eigen::Vector3d::Zero();
  double num = 0.0;
  for (const MapPoint& point : report.map) {
    if (!point.is_known) continue;
    target += point.point_in_world;
    num += 1.0;
  }
  GivenNumber focal{.name = "focal length", .moved = "the distance (z)"};
  GivenNumber centre{.name = "centre u", .moved = "the rotation about y"};
  if (num > 0.0) target /= num;
  const double turn_rad = 1.0 / params(report.camera.lens)[0];
  for (const PathStep& step : report.path) {
    if (!step.has_pose() || num == 0.0) continue;
    const double distance_m = (step.world_from_cam.translation - target).norm();
    if (const double moves = distance_m / std::sqrt(step.cov(2, 2)); moves > focal.moves) {
      focal.moves = moves;
      focal.moved_by = distance_m;
    }
    centre.moves = std::max(centre.moves, turn_rad / std::sqrt(step.cov(4, 4)));
    centre.moved_by = turn_rad;
  }
  const auto& cov = report.camera.cov;
  if (cov.size() > 0) {
    focal.sigma = std::sqrt(cov(0, 0)) / params(report.camera.lens)[0];
    centre.sigma = std::sqrt(cov(2, 2));
  }
  return {focal, centre};
}

struct Named {
  std::string_view given;
  const char* name;
  double ordinary;
};
constexpr std::array<Named, 4> all_named{{{"focal length", "camera.f (relative)", ordinary_focal},
                                          {"centre u", "camera.cx", ordinary_centre_px},
                                          {"centre v", "camera.cy", ordinary_centre_px},
                                          {"scale of the target", "target.scale", ordinary_scale}}};

}  // namespace

std::vector<Assumption> localize_assumed(const LocalizeReport& report) {
  std::vector<Assumption> assumed;
  const bool is_estimated = report.sigma_lens.size() > 0;
  if (!std::ranges::any_of(report.path, &PathStep::has_pose)) return assumed;
  for (const GivenNumber& given : report.is_smoothed ? report.given : roughly_given(report)) {
    const auto named = std::ranges::find(all_named, given.name, &Named::given);
    if (named == all_named.end()) continue;
    const bool is_scale = named->given == "scale of the target";
    if (!is_scale && !report.is_smoothed && is_estimated) continue;
    Assumption each;
    each.name = named->name;
    each.value = is_scale                     ? 1.0
                 : named->given == "centre u" ? params(report.camera.lens)[2]
                 : named->given == "centre v" ? params(report.camera.lens)[3]
                                              : params(report.camera.lens)[0];
    each.sigma = is_scale && !report.is_scale_told ? std::nullopt : given.sigma;
    each.ordinary = named->ordinary;
    const double error = each.sigma.value_or(named->ordinary);
    each.moves = given.moves * error;
    each.moved = std::string(given.moved);
    each.moved_by = given.moved_by * error;
    each.remedy = is_scale ? "give --sigma-scale, or σ in --target: sigma_m of each point, sigma_square_m of a board"
                           : remedy_camera;
    assumed.push_back(each);
  }
  return assumed;
}

}  // namespace alidade
