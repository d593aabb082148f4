#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string_view>
#include <utility>

#include "alidade/estimation/innovation.h"
#include "alidade/geometry/degree.h"
#include "alidade/rig/rig_given.h"
#include "alidade/rig/rig_work.h"

namespace alidade {
namespace {

using Status = RigReport::Status;

/// What a cause would have free.
struct Candidate {
  RigCause cause;
  FreedParams params;
};

/// An error of two periods per turn is no parameter: over the angles of a head a scale and one period do nearly as
/// well.
std::vector<int> params_of(const std::string& name) {
  const int axis = name.starts_with("tilt") ? 1 : 0;
  if (name == "camera.fx") return {focal_param};
  if (name == "camera.cx") return {centre_x_param};
  if (name == "camera.cy") return {centre_y_param};
  if (name.ends_with("_scale")) return {pan_scale_param + axis};
  if (name.ends_with("once a turn")) return {pan_cos_param + 2 * axis, pan_sin_param + 2 * axis};
  if (name.ends_with("backlash")) return {pan_backlash_param + axis};
  return {pan_scale_param + axis, pan_cos_param + 2 * axis, pan_sin_param + 2 * axis};
}

std::vector<int> params_of_all(const std::string& name) {
  if (name == "scales") return {pan_scale_param, tilt_scale_param};
  if (name == "once a turn") return {pan_cos_param, pan_sin_param, tilt_cos_param, tilt_sin_param};
  if (name == "backlash") return {pan_backlash_param, tilt_backlash_param};
  if (name == "camera.fx") return {focal_param};
  return {centre_x_param, centre_y_param};
}

bool is_of_lens(const Candidate& one) {
  const int param = one.params.begin()->second.front();
  return param >= focal_param && param <= centre_y_param;
}

Candidate candidate_of(const RigCause& cause, const Rig& rig) {
  Candidate candidate{cause, {}};
  constexpr std::string_view all = "all ";
  if (cause.name.starts_with(all)) {
    for (const RigHead& one : rig.heads) candidate.params[one.head.id] = params_of_all(cause.name.substr(all.size()));
  } else {
    const std::size_t dot = cause.name.find('.');
    candidate.params[std::stoi(cause.name.substr(4, dot - 4))] = params_of(cause.name.substr(dot + 1));
  }
  return candidate;
}

FreedParams with(FreedParams freed, const Candidate& more) {
  for (const auto& [head, params] : more.params)
    for (const int param : params)
      if (std::ranges::find(freed[head], param) == freed[head].end()) freed[head].push_back(param);
  return freed;
}

std::size_t num_of(const FreedParams& freed) {
  std::size_t num = 0;
  for (const auto& [head, params] : freed) num += params.size();
  return num;
}

/// By Schwarz's criterion: so many views, so many parameters more.
double score_of(const RigReport& report, const FreedParams& freed) {
  return report.deviance + static_cast<double>(num_of(freed)) * std::log(2.0 * report.views_used);
}

class ByNeed {
 public:
  ByNeed(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points, const std::map<int, Camera>& cameras,
         RigConfig config, const Progress& progress, RigReport report)
      : views_(views), points_(points), cameras_(cameras), config_(std::move(config)), progress_(progress) {
    // Two solves are compared by the same σ of a corner.
    if (!config_.sigma_px) config_.sigma_px = report.sigma_px;
    best_ = std::move(report);
    sigma_px_is_estimated_ = best_.sigma_px_is_estimated;
  }

  /// Scales that are not given are estimated where holding them matters. Where the views do not contradict what such
  /// encoders ordinarily have, that counts as well.
  void free_ungiven_scales() {
    if (config_.sigma_scale || config_.estimate_scales) return;
    const bool matters = std::ranges::any_of(best_.assumed, [](const Assumption& what) {
      return what.name.ends_with("_scale") && !what.sigma && what.moves > 1.0;
    });
    if (!matters) return;
    FreedParams scales;
    for (const RigHead& rig_head : best_.rig.heads) scales[rig_head.head.id] = {pan_scale_param, tilt_scale_param};
    auto trial = solve(scales);
    if (!trial) return;
    freed_ = std::move(scales);
    best_ = std::move(*trial);
    if (!are_ordinary(best_.rig)) return;
    sigma_free_scale_ = ordinary_scale;
    if (auto with_prior = solve(freed_))
      best_ = std::move(*with_prior);
    else
      sigma_free_scale_ = 0.0;
  }

  /// The cause that explains the residuals best, one after another.
  void free_what_is_asked() {
    constexpr int most = 6;
    for (int round = 0; round < most && free_next(); ++round) continue;
  }

  RigReport result() && {
    best_.sigma_px_is_estimated = sigma_px_is_estimated_;
    describe();
    best_.alike = alike_;
    return std::move(best_);
  }

 private:
  /// Is no scale significantly another than one?
  static bool are_ordinary(const Rig& rig) {
    constexpr double most = 3.0;
    for (std::size_t h = 0; h < rig.heads.size(); ++h) {
      const Encoder& encoder = rig.heads[h].head.encoder;
      for (const int param : {pan_scale_param, tilt_scale_param}) {
        const double scale = param == pan_scale_param ? encoder.pan_scale : encoder.tilt_scale;
        const Eigen::Index at = num_head_params * static_cast<Eigen::Index>(h) + param;
        if (!(std::abs(scale - std::copysign(1.0, scale)) < most * std::sqrt(rig.cov(at, at)))) return false;
      }
    }
    return true;
  }

  /// None where the views do not determine it.
  std::optional<RigReport> solve(const FreedParams& freed) {
    constexpr double worst_rad = 2.0 * degree, worst_m = 0.05;
    if (undetermined_.contains(freed)) return std::nullopt;
    RigReport trial = calibrated_with(views_, points_, cameras_, config_, freed, progress_, {}, sigma_free_scale_);
    const bool is_given = trial.status == Status::converged && trial.sigma_relative_rad < worst_rad &&
                          trial.sigma_relative_m < worst_m && trial.views_used >= best_.views_used;
    if (is_given) return trial;
    undetermined_.insert(freed);  // nor later: the views used never become fewer
    return std::nullopt;
  }

  static const RigCause& first_of(const RigReport& report) {
    return *std::ranges::max_element(
        report.causes, {}, [](const RigCause& cause) { return cause.is_of_boards() ? cause.rank() : cause.sigmas; });
  }

  std::vector<Candidate> asked() const {
    constexpr double near = 0.5;  // of the largest: what one cause does looks to another's score like itself
    std::vector<Candidate> candidates;
    if (best_.causes.empty()) return candidates;
    const RigCause& first = first_of(best_);
    // It is named, and nothing else absorbs it. Boards that all moved would absorb nearly anything: first what else.
    if (first.has_no_parameter() && !first.is_of_boards() && first.sigmas > rig_cause_limit) return candidates;
    const double largest = first.is_of_boards() ? first.rank() : first.sigmas;
    for (const RigCause& cause : best_.causes) {
      const bool is_joint = cause.name.starts_with("all ");  // six of forty, and the ones that see most
      if (cause.sigmas < (is_joint ? rig_free_joint_limit : rig_free_limit)) continue;
      if (cause.sigmas < near * largest) continue;
      if (cause.has_no_parameter()) continue;
      Candidate next = candidate_of(cause, best_.rig);
      const bool is_new = num_of(with(freed_, next)) > num_of(freed_);
      if (is_new && candidates.size() < 8) candidates.push_back(std::move(next));
    }
    return candidates;
  }

  static bool are_boards_indicated(const RigReport& report) {
    return std::ranges::any_of(
        report.causes, [](const RigCause& cause) { return cause.is_of_boards() && cause.sigmas > rig_cause_limit; });
  }

  /// They are what would be named.
  static bool are_boards_first(const RigReport& report) {
    return are_boards_indicated(report) && first_of(report).is_of_boards();
  }

  /// A centre that is asked for by chance would make σ of all else larger.
  static bool is_centre_vague(const RigReport& report, const Candidate& candidate) {
    constexpr double max_px = 1.0;
    for (const RigHead& one : report.rig.heads) {
      const auto found = candidate.params.find(one.head.id);
      if (found == candidate.params.end()) continue;
      for (const int param : found->second) {
        const Eigen::Index k = param == centre_x_param ? 2 : param == centre_y_param ? 3 : -1;
        if (k >= 0 && one.camera.cov(k, k) > max_px * max_px) return true;
      }
    }
    return false;
  }

  bool free_next() {
    struct Trial {
      Candidate of;
      RigReport report;
      double score = 0.0;
    };
    std::vector<Trial> trials;
    for (const Candidate& candidate : asked()) {
      const FreedParams freed = with(freed_, candidate);
      auto report = solve(freed);
      if (!report || (are_boards_first(best_) && are_boards_indicated(*report)) ||
          (candidate.cause.sigmas < rig_cause_limit && is_centre_vague(*report, candidate)))
        continue;
      const double score = score_of(*report, freed);
      trials.push_back({candidate, std::move(*report), score});
    }
    if (trials.empty()) return false;
    std::ranges::sort(trials, {}, &Trial::score);
    constexpr double alike = 10.0;  // e⁵ to one
    Trial& first = trials.front();
    freed_ = with(freed_, first.of);
    best_ = std::move(first.report);
    for (const Trial& other : trials) {
      if (other.score > first.score + alike || is_of_lens(other.of) == is_of_lens(first.of)) continue;
      // Neither is to be preferred: both, and if the views do not determine both, it is reported.
      const FreedParams both = with(freed_, other.of);
      if (auto report = solve(both)) {
        freed_ = both;
        best_ = std::move(*report);
      } else {
        alike_ = first.of.cause.name + " and " + other.of.cause.name;
      }
      break;
    }
    return true;
  }

  void describe() {
    const Rig& rig = best_.rig;
    for (std::size_t h = 0; h < rig.heads.size(); ++h) {
      const auto found = freed_.find(rig.heads[h].head.id);
      if (found == freed_.end()) continue;
      for (const int param : found->second) best_.freed.push_back(freed_of(h, param));
    }
  }

  /// Each by itself may be small where the error of a period is plain.
  double pair_sigmas(std::size_t h, int param) const {
    const bool is_tilt = param >= tilt_cos_param;
    const Encoder& encoder = best_.rig.heads[h].head.encoder;
    const Eigen::Vector2d amplitudes = is_tilt ? Eigen::Vector2d(encoder.tilt_cos_rad, encoder.tilt_sin_rad)
                                               : Eigen::Vector2d(encoder.pan_cos_rad, encoder.pan_sin_rad);
    const Eigen::Index at = num_head_params * static_cast<Eigen::Index>(h) + (is_tilt ? tilt_cos_param : pan_cos_param);
    const Eigen::Matrix2d cov = best_.rig.cov.block<2, 2>(at, at);
    if (!(cov.determinant() > 0.0)) return 0.0;
    return score_sigmas(amplitudes.dot(cov.inverse() * amplitudes), 2.0, 0.0);
  }

  RigFreed freed_of(std::size_t h, int param) const {
    const RigHead& rig_head = best_.rig.heads[h];
    const Encoder& encoder = rig_head.head.encoder;
    RigFreed freed{.name = "head" + std::to_string(rig_head.head.id) + "." + rig_param_name(param)};
    if (param < num_head_params) {
      const Eigen::Index at = num_head_params * static_cast<Eigen::Index>(h) + param;
      freed.sigma = std::sqrt(best_.rig.cov(at, at));
      const bool is_scale = param == pan_scale_param || param == tilt_scale_param;
      freed.value = is_scale ? (param == pan_scale_param ? encoder.pan_scale : encoder.tilt_scale)
                             : std::array{encoder.pan_cos_rad, encoder.pan_sin_rad, encoder.tilt_cos_rad,
                                          encoder.tilt_sin_rad}[static_cast<std::size_t>(param - pan_cos_param)];
      if (is_scale) freed.was_sigma = counted_sigma_scale(config_).value_or(0.0);
      if (!is_scale) freed.pair_sigmas = pair_sigmas(h, param);
      freed.was = is_scale ? std::copysign(1.0, freed.value) : 0.0;  // its sign is detected, not a cause
    } else if (param >= pan_backlash_param) {
      const int axis = param - pan_backlash_param;
      freed.value = best_.backlash_rad[h][axis];
      freed.sigma = best_.sigma_backlash_rad[h][axis];
    } else {
      const Eigen::Index k = param == focal_param ? 0 : param == centre_x_param ? 2 : 3;
      freed.value = params(rig_head.camera.lens)[k];
      freed.sigma = std::sqrt(rig_head.camera.cov(k, k));
      const Camera& file = cameras_.at(rig_head.head.id);
      freed.was = params(file.lens)[k];
      if (k < file.cov.rows()) freed.was_sigma = std::sqrt(std::max(0.0, file.cov(k, k)));
    }
    return freed;
  }

  std::span<const HeadView> views_;
  std::span<const Eigen::Vector3d> points_;
  const std::map<int, Camera>& cameras_;
  RigConfig config_;
  const Progress& progress_;
  FreedParams freed_;
  double sigma_free_scale_ = 0.0;
  std::set<FreedParams> undetermined_;
  RigReport best_;
  bool sigma_px_is_estimated_ = false;
  std::string alike_;
};

}  // namespace

double RigFreed::sigmas() const { return std::max(pair_sigmas, std::abs(value - was) / std::hypot(sigma, was_sigma)); }

RigReport freed_by_need(RigReport report, std::span<const HeadView> views,
                        std::span<const Eigen::Vector3d> points_in_board, const std::map<int, Camera>& cameras,
                        const RigConfig& config, const Progress& progress) {
  ByNeed by_need(views, points_in_board, cameras, config, progress, std::move(report));
  by_need.free_what_is_asked();
  by_need.free_ungiven_scales();
  by_need.free_what_is_asked();
  return std::move(by_need).result();
}

}  // namespace alidade
