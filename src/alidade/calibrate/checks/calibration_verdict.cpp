#include "alidade/calibrate/checks/calibration_verdict.h"
#include "alidade/estimation/median.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>

#include "alidade/calibrate/checks/better_model.h"
#include "alidade/calibrate/checks/corner_numbering.h"
#include "alidade/calibrate/solve/weights.h"

namespace alidade {
namespace {

/// A number with two significant digits, as people read σ.
std::string rounded(double value, int digits) {
  std::array<char, 32> text{};
  if (!(std::abs(value) > 0.0)) return "0";
  const int decimals = std::clamp(digits - 1 - static_cast<int>(std::floor(std::log10(std::abs(value)))), 0, 6);
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

std::string two(double value) { return rounded(value, 2); }

State grade(double value, double care, double bad) {
  if (!(value <= bad)) return State::bad;  // NaN is bad, too
  return value <= care ? State::good : State::care;
}

/// Where in the image a pixel lies, for a user.
std::string place(const Eigen::Vector2d& px, const Camera& camera) {
  const double x = px.x() / camera.width_px, y = px.y() / camera.height_px;
  const std::string row = y < 1.0 / 3 ? "top" : y > 2.0 / 3 ? "bottom" : "";
  const std::string col = x < 1.0 / 3 ? "left" : x > 2.0 / 3 ? "right" : "";
  if (row.empty() && col.empty()) return "in the centre";
  return "at the " + row + (row.empty() || col.empty() ? "" : " ") + col;
}

struct Worst {
  double value = 0.0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
};

Worst worst_of(const PixelGrid& grid) {
  Worst worst;
  for (int row = 0; row < grid.rows; ++row) {
    for (int col = 0; col < grid.cols; ++col) {
      const double value = grid.values[static_cast<std::size_t>(row * grid.cols + col)];
      if (std::isfinite(value) && value > worst.value) worst = {value, grid.px(col, row)};
    }
  }
  return worst;
}

/// Share [%] of the image where 3σ is at most `limit_px`.
double share_below(const PixelGrid& sigma, double limit_px) {
  const auto below =
      std::count_if(sigma.values.begin(), sigma.values.end(), [&](double value) { return 3.0 * value <= limit_px; });
  return 100.0 * static_cast<double>(below) / static_cast<double>(std::max<std::size_t>(1, sigma.values.size()));
}

/// A share in words: 100 only where it is all of it.
std::string percent(double share) { return two(share < 100.0 && share > 99.0 ? 99.0 : share); }

Check coverage(const CalibrateReport& report, const CalibrationStudy& study) {
  constexpr double wanted_px = 1.0;
  const Worst worst = worst_of(study.sigma_infinity);
  Check check{.name = "coverage",
              .value = share_below(study.sigma_infinity, wanted_px),
              .limit = 95.0,
              .unit = "%",
              .figure = "sigma"};
  // A large σ is reported and included: not to be trusted is only an answer useless over half of the image.
  const double useless_px = 0.01 * std::max(report.camera.width_px, report.camera.height_px);
  const bool is_answer = share_below(study.sigma_infinity, useless_px) >= 50.0;
  check.state = check.value >= 95.0 ? State::good : is_answer ? State::care : State::bad;
  check.text = "3σ is below 1 px in " + percent(check.value) + " % of the image; worst " + two(3.0 * worst.value) +
               " px, " + place(worst.px, report.camera);
  return check;
}

Check lens_adequate(const CalibrationStudy& study) {
  Check check{.name = "lens adequate", .limit = 3.0, .unit = "σ", .figure = "rings"};
  for (const ResidualRing& ring : study.rings) {
    if (ring.count < 10) continue;
    check.value = std::max({check.value, std::abs(ring.mean_radial_px) / ring.sigma_px,
                            std::abs(ring.mean_tangential_px) / ring.sigma_px});
  }
  const HeldOutModel* better = nullptr;
  for (const HeldOutModel& model : study.models) {
    const bool gains = model.is_richer && model.gain_px > 2.0 * model.sigma_px && model.gain_px > 0.0;
    if (gains && (!better || model.gain_px > better->gain_px)) better = &model;
  }
  check.state = grade(check.value, 3.0, 8.0);
  check.text = check.state == State::good ? "no ring departs from zero by more than 3σ"
                                          : "a ring departs from zero by " + two(check.value) + "σ";
  if (!study.lens_error.empty()) {
    check.state = std::max(check.state, State::care);
    check.text = study.lens_error + ": σ includes what it moves, not what is left where no boards were";
  }
  if (better) {
    check.state = std::max(check.state, State::care);
    check.text = better->name + " lowers the held-out error by " + two(better->gain_px) + " ± " +
                 two(3.0 * better->sigma_px) + " px";
  }
  return check;
}

Check consistent(const CalibrationStudy& study) {
  Check check{.name = "consistent", .limit = 3.0, .unit = "σ", .figure = "halves"};
  if (!study.halves) {
    check.state = State::care;
    check.text = "too few photos to compare two halves";
    return check;
  }
  check.value = study.halves->worst_z;
  check.limit = study.halves->limit;
  check.state = grade(check.value, check.limit, 6.0);
  check.text = "halves differ by " + two(check.value) + "σ in " + study.halves->worst_name;
  return check;
}

/// Corners against their own σ, and against the bulk of the others.
struct Tails {
  double ratio = std::nan("");  ///< RMS over what the corners' covariances predict.
  int far = 0;  ///< Corners more than 6 robust σ off, in pixels and in units of their own σ; rejected ones among them.
  int far_in_use = 0;
  double worst_px = 0.0;  ///< The farthest of these.
  std::string worst_photo;
  int worst_index = 0;
};

/// Six robust σ of distances in the plane.
double far_limit(const std::vector<double>& norms) { return 6.0 * median_of(norms) / std::sqrt(2.0 * std::log(2.0)); }

/// How far a corner is from where the fit puts it.
struct CornerDistance {
  std::size_t photo, index;  ///< In the views.
  double norm_px, norm;      ///< In pixels, and in units of its own σ where it has one.
};

Tails corner_tails(const CalibrateReport& report, std::span<const BoardView> views) {
  Tails tails;
  std::vector<CornerDistance> corners;
  std::vector<double> norms_px, norms;
  double predicted = 0.0, seen = 0.0;
  const bool has_cov = have_covariances(views);
  for (std::size_t k = 0; k < views.size(); ++k) {
    if (!report.views[k].used) continue;
    for (std::size_t i = 0; i < views[k].corners.size(); ++i) {
      const CornerResidual& fit = report.views[k].corners[i];
      if (!fit.residual_px.allFinite()) continue;
      const double norm_px = fit.residual_px.norm(), trace = views[k].corners[i].cov.trace();
      corners.push_back({k, i, norm_px, norm_px / (has_cov ? std::sqrt(0.5 * trace) : 1.0)});
      norms_px.push_back(corners.back().norm_px);
      norms.push_back(corners.back().norm);
      predicted += fit.used ? trace : 0.0;
      seen += fit.used ? fit.residual_px.squaredNorm() : 0.0;
    }
  }
  if (corners.empty()) return tails;
  // A blurred corner may be far off in pixels, a sharp one in a σ that knows noise alone.
  const double limit_px = far_limit(norms_px), limit = far_limit(norms);
  for (const CornerDistance& corner : corners) {
    if (!(corner.norm_px > limit_px && corner.norm > limit)) continue;
    ++tails.far;
    tails.far_in_use += report.views[corner.photo].corners[corner.index].used ? 1 : 0;
    if (corner.norm_px <= tails.worst_px) continue;
    tails.worst_px = corner.norm_px;
    tails.worst_photo = views[corner.photo].photo;
    tails.worst_index = views[corner.photo].corners[corner.index].index;
  }
  if (has_cov) tails.ratio = std::sqrt(seen / predicted);
  return tails;
}

Check honest_corners(const CalibrateReport& report, std::span<const BoardView> views) {
  const Tails tails = corner_tails(report, views);
  Check check{.name = "honest corners", .limit = 2.0, .unit = "", .figure = "residuals"};
  if (std::isfinite(tails.ratio)) {
    check.value = tails.ratio;
    check.state = grade(tails.ratio, 2.0, 20.0);
    check.text = "RMS is " + two(tails.ratio) + " × what the corners' own σ predicts";
  } else {
    constexpr double usual_px = 0.25;  // RMS of a good detector on a good board stays below
    check.value = report.rms_px;
    check.limit = usual_px;
    check.unit = "px";
    check.state = grade(report.rms_px, usual_px, 4.0 * usual_px);
    check.text = "RMS " + two(report.rms_px) + " px; the corners bring no σ to compare with";
  }
  if (tails.far > 0) {
    constexpr double plainly_wrong_px = 0.5;  // no blur and no board shape puts a corner there
    // Tails of one in a hundred are usual, and included in σ.
    const bool many = tails.far_in_use > 2 + report.corners_used / 100 && tails.worst_px > plainly_wrong_px;
    check.state = std::max(check.state, many ? State::bad : State::care);
    check.text += "; " + std::to_string(tails.far) + (tails.far == 1 ? " corner is" : " corners are") +
                  " more than 6σ off, the worst " + two(tails.worst_px) + " px (" + tails.worst_photo + ", corner " +
                  std::to_string(tails.worst_index) + ")";
  }
  return check;
}

Check board_flat(const CalibrationStudy& study, const CalibrateConfig& config) {
  Check check{.name = "board flat", .limit = 0.95, .unit = "", .figure = "board"};
  if (!study.transfer) {
    check.state = State::care;
    check.text = "too few photos to test the board's shape";
    return check;
  }
  const bool is_given = config.board_shape == BoardShape::given;
  const ShapeTransfer& transfer = *study.transfer;
  const std::string figures = "RMS of unseen photos " + rounded(transfer.flat_rms_px, 3) + " px " +
                              (is_given ? "with the board as given, " : "flat, ") +
                              rounded(transfer.transfer_rms_px, 3) + " px with the shape learned on the others (" +
                              shape_name(transfer.shape) + ")";
  check.value = transfer.transfer_rms_px / transfer.flat_rms_px;
  const bool is_free = config.board_shape == BoardShape::free;
  if (!study.print_error.empty() && !(is_free && transfer.transfers())) {
    check.state = is_free ? State::good : State::care;
    check.text = study.print_error + (is_free ? ": every point is estimated" : ": σ includes it");
  } else if (config.board_shape == BoardShape::bow || is_free) {
    check.state = transfer.transfers() ? State::good : State::bad;
    check.text = (transfer.transfers() ? "the shape transfers: " : "the shape does not transfer: ") + figures;
  } else {
    check.state = transfer.is_proved() ? State::care : State::good;
    check.text = (transfer.is_proved() ? (is_given ? "the board has another shape: " : "the board bends: ")
                                       : (is_given ? "as given, as far as the photos determine: "
                                                   : "flat as far as the photos determine: ")) +
                 figures;
  }
  return check;
}

Check principal_point(const CalibrateReport& report) {
  const Eigen::VectorXd values = params(report.camera.lens);
  const double x = (values[2] + 0.5) / report.camera.width_px - 0.5,
               y = (values[3] + 0.5) / report.camera.height_px - 0.5;
  Check check{.name = "principal point",
              .value = 100.0 * std::max(std::abs(x), std::abs(y)),
              .limit = 15.0,
              .unit = "%",
              .figure = "estimate"};
  check.state = grade(check.value, 15.0, 35.0);
  check.text = two(check.value) + " % of the image from its centre";
  return check;
}

/// Whether the printed side of a flat board is seen as if through it: z of the board points away from who sees it.
Check from_the_front(const CalibrateReport& report, std::span<const BoardView> views) {
  const bool is_flat = is_nearly_flat(report.board_points);
  std::size_t behind = 0, seen = 0;
  std::string photo;
  for (std::size_t i = 0; i < report.views.size(); ++i) {
    const ViewFit& view = report.views[i];
    if (!view.used || !is_flat) continue;
    ++seen;
    if (view.cam_from_board.inverse().translation.z() > 0.0 && behind++ == 0) photo = views[i].photo;
  }
  Check check{.name = "mirrored", .unit = ""};
  check.value = static_cast<double>(behind);
  if (behind == 0) {
    check.text = "boards are seen from the front";
    return check;
  }
  check.state = State::care;
  const std::string which = behind == seen ? "all boards are"
                                           : std::to_string(behind) + " of " + std::to_string(seen) +
                                                 " boards, the first in " + photo + ", are";
  check.text = which +
               " seen from behind: either their corners are numbered the other way, which does no harm, or the "
               "images are mirrored, and cx and p2 with them";
  return check;
}

/// Where another lens fits nearly as well: which. Only then is there anything to check.
std::optional<Check> one_lens(const CalibrateReport& report) {
  constexpr double ruled_out = 0.01;
  const OtherLens* other = nullptr;
  for (const OtherLens& each : report.other_lenses)
    if (each.weight > ruled_out && (other == nullptr || each.weight > other->weight)) other = &each;
  if (other == nullptr) return std::nullopt;
  const Eigen::VectorXd here = params(report.camera.lens), there = params(other->lens);
  return Check{.name = "one lens",
               .state = State::care,
               .text = "another lens fits these photos nearly as well, with its centre at (" + rounded(there[2], 3) +
                       ", " + rounded(there[3], 3) + ") px instead of (" + rounded(here[2], 3) + ", " +
                       rounded(here[3], 3) + "): σ reaches to it",
               .value = other->weight,
               .limit = ruled_out,
               .unit = "",
               .figure = "estimate"};
}

/// What to do next. What makes σ large comes first: more photos of a board that is not flat are no help.
std::string advice(const Verdict& verdict, const CalibrationStudy& study, const CalibrateConfig& config,
                   const NextPhotoPlan& next, double worst_px, bool is_port) {
  const auto ails = [&](const std::string& name) {
    return std::any_of(verdict.checks.begin(), verdict.checks.end(),
                       [&](const Check& check) { return check.name == name && check.state != State::good; });
  };
  const auto text_starts = [&](const std::string& name, const std::string& words) {
    return std::any_of(verdict.checks.begin(), verdict.checks.end(),
                       [&](const Check& check) { return check.name == name && check.text.starts_with(words); });
  };
  const bool wrong_corners = std::any_of(verdict.checks.begin(), verdict.checks.end(), [](const Check& check) {
    return check.name == "honest corners" && check.state == State::bad;
  });
  const std::string better_model = is_port ? "" : better_model_advice(study, config);
  if (ails("mirrored")) return "give images as the camera takes them, and corners row by row from left to right";
  if (wrong_corners && better_model.empty()) return "look at the corners named, or extract them again";
  if (text_starts("board flat", "the board bends")) return "use --board-shape " + shape_name(study.transfer->shape);
  if (text_starts("board flat", "the board has another shape"))
    return "use --board-shape auto, or this board's own points";
  if (ails("board flat") && text_starts("board flat", "the print")) return "use --board-shape free";
  if (ails("lens adequate") && is_port) return "check the lens in air, --glass and --n-water, or take --model brown";
  if (!better_model.empty()) return better_model + ", which fits better on held-out photos";
  if (!study.lens_error.empty()) return study.lens_remedy;
  if (ails("lens adequate"))
    return "no other lens model fits better: keep focus and zoom still, and look at the rings for where it departs";
  if (ails("coverage") && !next.photos.empty()) {
    return "add a photo as proposed: it lowers the worst 3σ from " + two(worst_px) + " to " +
           two(next.photos.front().worst_3sigma_px) + " px";
  }
  if (ails("one lens"))
    return "add photos with the board tilted 30–45° and turned about its own axis, or hold k3: --fix k3";
  if (!study.halves) return "add photos: from six on two halves are compared";
  return ails("consistent") ? "add photos: the halves do not agree" : "";
}

}  // namespace

Verdict calibration_verdict(const CalibrateReport& report, const CalibrationStudy& study,
                            std::span<const BoardView> views, const CalibrateConfig& config,
                            const NextPhotoPlan& next) {
  Verdict verdict;
  verdict.checks = {coverage(report, study),
                    lens_adequate(study),
                    consistent(study),
                    clusters_agree(report.clusters, "photo",
                                   "blur, rolling shutter, the lens model, or the board's shape", "clusters"),
                    honest_corners(report, views),
                    from_the_front(report, views),
                    board_flat(study, config),
                    principal_point(report)};
  if (std::optional<Check> other = one_lens(report)) verdict.checks.push_back(std::move(*other));
  const Check* worst = &verdict.checks.front();
  for (const Check& check : verdict.checks) {  // among equals not coverage, with which the sentence begins
    if (check.state > worst->state || (check.state == worst->state && worst->name == "coverage")) worst = &check;
  }
  verdict.state = worst->state;
  for (const Check& check : verdict.checks) {  // halves that differ are a symptom of it
    if (check.name == "board flat" && check.state == State::care && study.transfer) worst = &check;
  }
  const std::string trust =
      "3σ is below 0.5 px in " + percent(share_below(study.sigma_infinity, 0.5)) + " % of the image";
  const std::string word = verdict.state == State::good   ? "Good: "
                           : verdict.state == State::care ? "Usable with care: "
                                                          : "Not to be trusted: ";
  verdict.sentence = word + trust;
  if (worst->state != State::good && worst->name != "coverage") verdict.sentence += "; " + worst->text;
  verdict.to_add =
      advice(verdict, study, config, next, 3.0 * worst_of(study.sigma_infinity).value, !is_central(report.camera.lens));
  return verdict;
}

Verdict refusal_verdict(const CalibrateReport& report) {
  Verdict verdict;
  const bool degenerate = report.status == CalibrateReport::Status::degenerate;
  verdict.state = degenerate ? State::refused : State::not_converged;
  verdict.exit_code = degenerate ? ExitCode::undetermined : ExitCode::no_convergence;
  verdict.sentence = report.reason;
  verdict.to_add = report.to_add;
  return verdict;
}

}  // namespace alidade
