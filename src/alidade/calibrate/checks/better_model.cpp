#include "alidade/calibrate/checks/better_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <sstream>
#include <vector>

#include "alidade/calibrate/solve/weights.h"
#include "alidade/camera/camera_diff.h"

namespace alidade {
namespace {

bool is_central_parameter(const std::string& name) {
  return name == "fx" || name == "fy" || name == "cx" || name == "cy";
}

/// The config with another model: fixed values and priors of focal lengths and centre are kept, those of the distortion
/// not.
CalibrateConfig with_model(CalibrateConfig config, const std::string& model) {
  config.model = model;
  std::erase_if(config.fixed, [](const std::string& name) { return name != "skew" && !is_central_parameter(name); });
  std::erase_if(config.priors, [](const Prior& prior) { return !is_central_parameter(prior.name); });
  return config;
}

std::size_t num_corners(std::span<const BoardView> views) {
  std::size_t count = 0;
  for (const BoardView& view : views) count += view.corners.size();
  return count;
}

/// "use --model brown --free skew" for a step of the held-out ladder, whose name lists its brown terms.
std::string options_for(const std::string& name, const CalibrateConfig& config) {
  if (name == "kannala_brandt") return "use --model kannala_brandt";
  std::vector<std::string> terms;
  std::istringstream words(name);
  for (std::string word; words >> word;) terms.push_back(word);
  const auto is_in = [](const std::vector<std::string>& names, const std::string& term) {
    return std::find(names.begin(), names.end(), term) != names.end();
  };
  const auto has = [&](const std::string& term) { return is_in(terms, term); };
  std::string fixed;
  bool had_fix = false;
  for (const std::string term : {"k1", "k2", "p1", "p2", "k3"}) {
    if (!has(term)) fixed += (fixed.empty() ? "" : ",") + term;
    had_fix = had_fix || is_in(config.fixed, term);
  }
  std::string options = config.model == "brown" ? "" : " --model brown";
  if (!fixed.empty()) options += " --fix " + fixed;
  if (has("skew")) options += " --free skew";
  if (options.empty()) return "omit --fix";
  return "use" + options + (fixed.empty() && had_fix && config.model == "brown" ? ", and no --fix" : "");
}

/// Sum of squares of the views' residuals, by the corners' own σ where they have one; NaN where a view was rejected.
double squares_of(std::span<const BoardView> views, const CalibrateReport& report) {
  const bool has_cov = have_covariances(views);
  double sum = 0.0;
  for (std::size_t k = 0; k < views.size(); ++k) {
    if (!report.views[k].used) return std::nan("");
    for (std::size_t i = 0; i < views[k].corners.size(); ++i) {
      const double weight = has_cov ? 2.0 / views[k].corners[i].cov.trace() : 1.0;
      sum += weight * report.views[k].corners[i].residual_px.squaredNorm();
    }
  }
  return sum;
}

/// exp(−Δχ²/2), the corners of a photo sharing errors as they do.
double weight_of(double squares, double squares_of_rival, const CalibrateReport& report) {
  const double dof = std::max(1.0, 2.0 * report.corners_used - report.num_parameters);
  const double excess = std::max(0.0, dof * (squares_of_rival / squares - 1.0));
  return std::exp(-0.5 * excess / std::max(1.0, report.clusters.design_effect));
}

}  // namespace

std::optional<RivalModel> rival_model(const Board& board, std::span<const BoardView> views,
                                      const CalibrateConfig& config, const CalibrateReport& report) {
  constexpr double ruled_out = 0.01, agree_sigmas = 3.0;
  const bool is_brown = config.model == "brown";
  if (!is_brown && config.model != "kannala_brandt") return std::nullopt;
  CalibrateConfig other = with_model(config, is_brown ? "kannala_brandt" : "brown");
  other.board_shape = BoardShape::given;
  const std::vector<BoardView> used = used_views(views, report, 60);
  const ImageSize size{report.camera.width_px, report.camera.height_px};
  CalibrateConfig same = config;  // from these corners alone, too
  same.board_shape = BoardShape::given;
  CalibrateReport rival = calibrate(board, used, size, other, report.board_points);
  const CalibrateReport own = calibrate(board, used, size, same, report.board_points);
  const auto converged = CalibrateReport::Status::converged;
  if (rival.status != converged || own.status != converged) return std::nullopt;
  const double weight = weight_of(squares_of(used, own), squares_of(used, rival), report);
  if (!(weight > ruled_out)) return std::nullopt;
  rival.camera.cov.resize(0, 0);  // in σ of what is stated
  const auto diff = diff_cameras(report.camera, rival.camera, {.cols = 30, .rows = 20});
  if (!diff) return std::nullopt;
  RivalModel found{.model = other.model, .weight = weight};
  for (int row = 0; row < diff->in_sigmas.rows; ++row) {
    for (int col = 0; col < diff->in_sigmas.cols; ++col) {
      const auto at = static_cast<std::size_t>(row * diff->in_sigmas.cols + col);
      if (!(diff->in_sigmas.values[at] > found.sigmas)) continue;
      found.sigmas = diff->in_sigmas.values[at];
      found.apart_px = std::hypot(diff->delta_u.values[at], diff->delta_v.values[at]);
      found.px = diff->in_sigmas.px(col, row);
    }
  }
  return found.sigmas > agree_sigmas ? std::optional(found) : std::nullopt;
}

void heed_rival_model(const RivalModel& rival, Verdict& verdict) {
  Check check{.name = "one model", .state = State::care, .value = rival.sigmas, .limit = 3.0, .unit = "σ"};
  check.figure = "sigma";
  check.text = rival.model + " fits these photos as well, and differs by " + text_of(rival.apart_px, 2) + " px (" +
               text_of(rival.sigmas, 2) + "σ) at (" + text_of(rival.px.x(), 4) + ", " + text_of(rival.px.y(), 4) +
               "): no board says which is right there";
  heed(check, "cover the image with boards to its edges, or use no more of it than they cover", verdict);
}

std::optional<FittingModel> fitting_model(const Board& board, std::span<const BoardView> views, ImageSize size,
                                          const CalibrateConfig& config, const CalibrateReport& failed) {
  if (config.model == "flat_port") return std::nullopt;
  std::vector<BoardView> seen;  // for a lens too plain, corners of wide views are outliers: all are tried again
  for (std::size_t k = 0; k < views.size(); ++k) {
    if (!views[k].corners.empty() && !failed.views[k].reason.starts_with("is the same")) seen.push_back(views[k]);
  }
  std::optional<FittingModel> best;
  for (const std::string model : {"brown", "kannala_brandt"}) {
    if (model == config.model && config.fixed.size() <= 1) continue;
    CalibrateConfig other = with_model(config, model);
    if (other.board_shape != BoardShape::given) other.board_shape = BoardShape::flat;
    const CalibrateReport tried = calibrate(board, seen, size, other, failed.board_points);
    if (tried.status != CalibrateReport::Status::converged) continue;
    const bool takes_all = 20 * static_cast<std::size_t>(tried.corners_used) >= 19 * num_corners(seen);
    const bool is_clear = !(tried.rms_px > 0.5 * failed.rms_px);  // a solve that failed may have no RMS
    constexpr double fits_px = 2.0;                               // more is no noise of corners, whatever the camera
    if (takes_all && is_clear && tried.rms_px <= fits_px && (!best || tried.rms_px < best->rms_px))
      best = FittingModel{model, tried.rms_px};
  }
  return best;
}

void advise_fitting_model(const Board& board, std::span<const BoardView> views, ImageSize size,
                          const CalibrateConfig& config, CalibrateReport& report) {
  constexpr double misfit_px =
      1.0;  // no detector errs so much: where a parameter is undetermined at this, the lens is wrong
  const bool is_settled = report.status != CalibrateReport::Status::no_convergence;
  if (is_settled && !(report.num_parameters > 0 && report.rms_px > misfit_px)) return;
  const auto found = fitting_model(board, views, size, config, report);
  if (!found) return;
  std::array<char, 32> rms{};
  std::snprintf(rms.data(), rms.size(), "%.3g", found->rms_px);
  const bool is_same = found->model == config.model;
  if (!is_settled) report.reason = config.model + (is_same ? " as fixed" : "") + " does not fit these corners";
  report.to_add = (is_same ? "omit --fix: " + found->model : "use --model " + found->model + ": it") +
                  " fits these corners with RMS " + rms.data() + " px";
}

std::string better_model_advice(const CalibrationStudy& study, const CalibrateConfig& config) {
  const HeldOutModel* best = nullptr;
  for (const HeldOutModel& model : study.models) {
    const bool gains = model.is_richer && model.gain_px > 2.0 * model.sigma_px && model.gain_px > 0.0;
    if (gains && (best == nullptr || model.gain_px > best->gain_px)) best = &model;
  }
  return best == nullptr ? "" : options_for(best->name, config);
}

}  // namespace alidade
