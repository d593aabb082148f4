#include <algorithm>
#include <cmath>

#include "alidade/estimation/median.h"
#include "alidade/geometry/degree.h"
#include "alidade/observe/solve/solve.h"

namespace alidade {
namespace {

constexpr double max_ordinary_px = 2.0, max_possible_px = 6.0;  // noise of a point detector
constexpr double many_rejected = 0.2, max_rejected = 0.4;       // share of the observations
constexpr double moves_beyond = 4.0;                            // a track's RMS over the median of the others

/// The indicated causes, the one that explains best first.
std::vector<const CauseScore*> asked_for(const ObserveSolution& report) {
  std::vector<const CauseScore*> asked;
  for (const CauseScore& cause : report.causes) {
    if (cause.z >= asked_beyond(report)) asked.push_back(&cause);
  }
  std::stable_sort(asked.begin(), asked.end(),
                   [](const CauseScore* a, const CauseScore* b) { return a->gain > b->gain; });
  return asked;
}

/// "k1 −0.1"; of several members the one that is largest over its σ.
std::string size_of(const CauseScore& cause) {
  const auto worst =
      std::max_element(cause.members.begin(), cause.members.end(), [](const CauseMember& a, const CauseMember& b) {
        return std::abs(a.value) * b.sigma < std::abs(b.value) * a.sigma;
      });
  if (worst == cause.members.end()) return "";
  return (worst->name == cause.name ? "" : worst->name + " ") + text_of(worst->value, 2) +
         (worst->unit.empty() ? "" : " " + worst->unit);
}

constexpr const char* step_advice =
    "was the camera or its lens bumped, or the head zeroed again? part the log there, each part has a mounting of its "
    "own";

bool is_zoom(const CauseScore& cause) { return cause.name == "focal length that varies"; }

std::string advice_for(const CauseScore& cause) {
  if (is_zoom(cause)) return "one camera is no answer: let zoom and focus rest, or stay as they are";
  if (cause.name == step_cause) return step_advice;
  const std::string word = estimate_word_of(cause.name);
  if (word == "scale") return "measure the scale with a known rotation, or --estimate scale --sigma-encoder-scale S";
  return "--estimate " + word;
}

Check noise_check(const ObserveSolution& report) {
  Check check{"noise", State::good, "", report.sigma_px, max_ordinary_px, "px", "residuals"};
  check.text = "σ of a pixel is " + text_of(report.sigma_px, 2) + " px";
  if (!report.sigma_is_estimated) return check;
  if (check.value > max_ordinary_px) {
    check.state = check.value > max_possible_px ? State::bad : State::care;
    check.text += ": no finder of points is so unsure, something else moves them";
  }
  return check;
}

Check rejected_check(const ObserveSolution& report) {
  const auto out = static_cast<double>(report.pixels_rejected);
  const double all = out + static_cast<double>(report.reference.bundle.observations.size());
  Check check{"rejected", State::good, "", all > 0.0 ? 100.0 * out / all : 0.0, 100.0 * many_rejected,
              "%",        "residuals"};
  check.text = text_of(check.value, 2) + " % of the pixels were rejected";
  if (check.value > 100.0 * many_rejected) {
    check.state = check.value > 100.0 * max_rejected ? State::bad : State::care;
    check.text += ": points move, or are taken for each other";
  }
  return check;
}

/// Check for tracks whose residuals are far larger than those of the others: moving points.
Check points_check(const ObserveSolution& report) {
  const Adjustment& reference = report.reference;
  const std::size_t num = reference.bundle.points.size();
  std::vector<double> squares(num, 0.0), count(num, 0.0), rms;
  for (std::size_t i = 0; i < reference.bundle.observations.size(); ++i) {
    const auto point = static_cast<std::size_t>(reference.bundle.observations[i].point);
    if (!std::isfinite(reference.solution.residual_px[i])) continue;
    squares[point] += reference.solution.residual_px[i] * reference.solution.residual_px[i];
    count[point] += 2.0;
  }
  constexpr double min_pixels = 20.0;
  for (std::size_t i = 0; i < num; ++i) {
    if (count[i] >= min_pixels) rms.push_back(std::sqrt(squares[i] / count[i]));
  }
  Check check{"points stand still", State::good, "", 0.0, moves_beyond, "", "points"};
  if (rms.size() < 3) {
    check.text = "too few points to compare";
    return check;
  }
  const double typical = median_of(rms);
  std::string names;
  for (std::size_t i = 0; i < reference.bundle_point_of.size(); ++i) {
    const int place = reference.bundle_point_of[i];
    if (place < 0 || count[static_cast<std::size_t>(place)] < min_pixels) continue;
    const auto at = static_cast<std::size_t>(place);
    const double ratio = std::sqrt(squares[at] / count[at]) / std::max(typical, 1e-12);
    check.value = std::max(check.value, ratio);
    if (ratio > moves_beyond) names += (names.empty() ? "" : ", ") + std::to_string(i + 1);
  }
  check.text =
      names.empty() ? "every point fits about as well as the others" : "point " + names + " moves, or is not one point";
  if (!names.empty()) check.state = State::care;
  return check;
}

Check reference_check(const ObserveSolution& report) {
  constexpr double care = 3.0, bad = 5.0;
  Check check{"agrees with all rows together", State::good, "", report.from_reference, care, "σ", "intrinsics"};
  check.text = "the answer is " + text_of(check.value, 2) + "σ from the adjustment of all rows together";
  if (check.value > care) check.state = check.value > bad ? State::bad : State::care;
  return check;
}

/// Ratio of σ with errors that last along the tracks to the model's, and whether it can be estimated well.
Check lasting_check(const ObserveSolution& report) {
  constexpr double most = 12.0;  // above it, the errors last about as long as the log
  const StatedCovariance& stated = report.stated;
  const auto count = std::min(stated.lasting.rows(), report.reference.solution.information.rows());
  Check check{"errors last", State::good, "", 1.0, most, "", "residuals"};
  const CommonMatrix model = report.reference.solution.covariance();
  for (Eigen::Index i = 0; i < count; ++i) {
    check.value = std::max(check.value, std::sqrt(stated.lasting(i, i) / model(i, i)));
  }
  check.text = stated.correlation_s > 0.0
                   ? "errors of a track last for " + text_of(stated.correlation_s, 2) + " s: σ is up to " +
                         text_of(check.value, 2) + " times what pixels that err by themselves would give"
                   : "every pixel errs by itself";
  if (check.value > most) check.state = State::care;
  return check;
}

/// Check of a camera that was rotated on its mount.
Check step_check(const MountingStep& step) {
  const double angle_deg = step.rotation_rad.norm() / degree;
  return {std::string("needs ") + step_cause,
          step.is_counted ? State::care : State::bad,
          "all rows are of one camera if it has a " + std::string(step_cause) + " at " + row_time_text(step.t_s) +
              " (" + text_of(angle_deg, 2) + "°): " + step_advice,
          angle_deg,
          0.0,
          "°",
          "residuals"};
}

/// Whether the residuals of a frame rotate together: noise of an encoder or gyroscope, independent from row to row.
Check jitter_check(const ObserveSolution& report) {
  const RotationJitter& jitter = report.jitter;
  const double sigma_rad = jitter.noise_rad();
  Check check{"rotation's noise",
              State::good,
              "frames do not jitter beyond their pixels' noise",
              jitter.f_ratio,
              RotationJitter::more_than_pixels,
              "",
              "residuals"};
  if (sigma_rad > 0.0) {
    check.state = State::care;
    check.text = "the pixels of a frame err together, as if its rotation were off by " +
                 text_of(sigma_rad / degree, 2) + "°: --rotation noisy --sigma-angle " + text_of(sigma_rad, 2);
  }
  return check;
}

/// Whether the estimated rotations differ from the measured ones as their σ predicts. With information Λ measured and F
/// from pixels, an error is estimated with gain s = F/(F + Λ) and pixel noise s²/F: σ² = Σ(ε² − s²/F) / Σs².
std::optional<Check> turn_noise_check(const BundleSolution& solution) {
  constexpr double max_ratio = 1.3, chance = 5.0;
  double squares = 0.0, weight = 0.0, sum_sigma = 0.0;
  for (std::size_t k = 0; k < solution.rotation_information.size(); ++k) {
    const double known = solution.rotation_information[k], seen = solution.rotation_information_seen[k];
    if (!(known > 0.0) || solution.rotations_walk) return std::nullopt;
    const double share = seen / (seen + known);
    squares += solution.rotation_errors[k].squaredNorm() / 3.0 - share / (seen + known);
    weight += share * share;
    sum_sigma += 1.0 / std::sqrt(known);
  }
  if (!(weight > 0.0)) return std::nullopt;
  const double sigma_rad = sum_sigma / static_cast<double>(solution.rotation_information.size());
  const double ratio = std::sqrt(std::max(squares / weight, 0.0)) / sigma_rad;
  const double limit = std::max(max_ratio, std::sqrt(1.0 + chance * std::sqrt(2.0 / (3.0 * weight))));
  Check check{"rotation's noise", State::good, "", ratio, limit, "", "residuals"};
  check.text =
      "the rotations err by " + text_of(ratio, 2) + " times their σ of " + text_of(sigma_rad / degree, 2) + "°";
  if (ratio > limit) {
    check.state = State::care;
    check.text += ": --sigma-angle " + text_of(ratio * sigma_rad, 2) + ", or what is wrong with them is not noise";
  }
  return check;
}

}  // namespace

namespace {

/// Half a turn about x compensates a pan of opposite sign or an image mirrored left to right; other axes likewise.
std::string half_turn_words(const Eigen::Vector3d& mount_rad) {
  const Eigen::Vector3d axis = mount_rad.cwiseAbs() / mount_rad.norm();
  constexpr double along = 0.95;
  if (mount_rad.norm() > 170.0 * degree) {
    if (axis.x() > along) return "pan (ω_y) counts the other way, or the image is mirrored left to right";
    if (axis.y() > along) return "tilt (ω_x) counts the other way, or the image is mirrored top to bottom";
    if (axis.z() > along) return "pan and tilt count the other way, or the camera hangs upside down";
  }
  return "axes are exchanged, a sign is reversed, or the image is mirrored, which no rotation undoes";
}

}  // namespace

Check rotation_check(const ObserveSolution& report) {
  constexpr double max_deg = 45.0;
  Check check{"rotation", State::good, "the rotation fits as it is read", 0.0, max_deg, "°", "residuals"};
  Eigen::Vector3d mount_rad = Eigen::Vector3d::Zero();
  for (const ObservedQuantity& quantity : report.quantities) {
    if (quantity.name == "mount_x_rad") mount_rad.x() = quantity.value;
    if (quantity.name == "mount_y_rad") mount_rad.y() = quantity.value;
    if (quantity.name == "mount_z_rad") mount_rad.z() = quantity.value;
  }
  check.value = mount_rad.norm() / degree;
  if (!report.misread.empty()) {
    check.state = State::bad;
    check.text = "the pixels fit better if the rotation is read otherwise: " + report.misread;
  } else if (check.value > max_deg) {
    check.state = State::bad;
    check.text = "the mount rotates by " + text_of(check.value, 3) + "°: " + half_turn_words(mount_rad);
  }
  return check;
}

double asked_beyond(const ObserveSolution& report) {
  constexpr double sigmas = 5.0;
  return sigmas * std::sqrt(report.jitter.is_noise() ? std::max(report.jitter.f_ratio, 1.0) : 1.0);
}

std::vector<Check> residual_checks(const ObserveSolution& report) {
  std::vector<Check> checks;
  if (report.mounting_step) checks.push_back(step_check(*report.mounting_step));
  const auto asked = asked_for(report);
  constexpr std::size_t max_named = 4;
  for (std::size_t i = 0; i < std::min(asked.size(), max_named); ++i) {
    const CauseScore& cause = *asked[i];
    std::string text = i == 0 ? "the residuals indicate " : "and ";
    text += cause.name + (std::isfinite(cause.from_s) ? " at " + row_time_text(cause.from_s) : "") + " (" +
            size_of(cause) + "; " + text_of(cause.z, 2) + "σ)";
    if (i == 0) text += ": " + advice_for(cause);
    const State state = i == 0 && is_zoom(cause) ? State::bad : State::care;
    checks.push_back({"needs " + cause.name, state, text, cause.z, asked_beyond(report), "σ", "residuals"});
  }
  if (asked.empty() && !report.causes.empty()) {
    const auto largest = std::max_element(report.causes.begin(), report.causes.end(),
                                          [](const CauseScore& a, const CauseScore& b) { return a.z < b.z; });
    checks.push_back({"causes", State::good,
                      "of " + std::to_string(report.causes.size()) +
                          " causes tested the residuals indicate none; most likely " + largest->name,
                      largest->z, asked_beyond(report), "σ", "residuals"});
  }
  if (!report.stated.blocks.z2.empty()) {
    checks.push_back(clusters_agree(report.stated.blocks, "block of time",
                                    "blur, noise of the angles, or what was taken as exact", "residuals"));
    checks.back().name = "blocks of time agree";
    checks.push_back(lasting_check(report));
  }
  checks.push_back(noise_check(report));
  if (report.jitter.f_ratio > 0.0) checks.push_back(jitter_check(report));
  if (const auto noise = turn_noise_check(report.reference.solution)) checks.push_back(*noise);
  checks.push_back(rejected_check(report));
  if (!report.reference.bundle_point_of.empty() && !report.causes.empty()) checks.push_back(points_check(report));
  if (report.from_reference > 0.0) checks.push_back(reference_check(report));
  return checks;
}

}  // namespace alidade
