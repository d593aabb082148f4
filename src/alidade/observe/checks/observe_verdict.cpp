#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/observe/checks/frame_places.h"
#include "alidade/observe/filters/fang_observer.h"
#include "alidade/observe/solve/solve.h"

namespace alidade {
namespace {

constexpr double fine = 0.003;  // σ over the focal length of a converged estimate

/// What the log does not determine, and why, depending on who rotated the camera; and what to add.
struct Reason {
  std::string name, what, add;
};

/// The field of view along the longer side of the image [rad]; none if the focal length is not known well enough.
std::optional<double> field_rad(const ObserveSolution& report) {
  constexpr double known_share = 0.1;
  if (report.quantities.empty()) return std::nullopt;
  const ObservedQuantity& f = report.quantities.front();
  if (!(f.value > 0.0 && f.sigma < known_share * f.value)) return std::nullopt;
  return 2.0 * std::atan(0.5 * std::max(report.width_px, report.height_px) / f.value);
}

/// A narrow field of view: all its parts move alike, wherever the rotation axis meets the image.
std::optional<Reason> narrow_field(const ObserveSolution& report, const ObserveSetup& config) {
  constexpr double min_share = 0.2;
  const std::optional<double> field = field_rad(report);
  if (!field || config.fixed_centre || report.motion.span_rad < min_share * *field) return std::nullopt;
  return Reason{"narrow field",
                "a field of " + text_of(*field / degree, 2) + "° is too narrow for a rotation of " +
                    text_of(report.motion.span_rad / degree, 2) + "° to determine cx and cy",
                "fix them: --fix-centre" + std::string(config.square_pixels ? "" : " --square-pixels") +
                    ", or rotate about the axis of view as well"};
}

Reason reason_of(const ObserveSolution& report, const RotationLog& log, const ObserveSetup& config) {
  const Eigen::Vector3d& path = report.motion.path_rad;  // rotation about x: tilt; y: pan; z: roll
  const double most = path.maxCoeff();
  constexpr double little = 0.02;  // share of the largest: below it, the axis did not rotate
  if (log.num_points == 0 || report.rows_used < 3) {
    return {"too few points", "too few points: " + std::to_string(report.rows_used) + " rows see any",
            "track at least one point through the rotation, better four"};
  }
  if (most < 0.2 * degree) return {"no motion", "the camera does not turn", "pan and tilt it by 5° or more"};
  if (path.y() < little * most && path.x() < little * most) {
    return {"roll only", "roll only: fx and fy cannot be determined", "pan and tilt the camera"};
  }
  if (path.x() < little * path.y()) {
    return {"pan only", "pan only: fy cannot be determined", "tilt the camera as well"};
  }
  if (path.y() < little * path.x()) {
    return {"tilt only", "tilt only: fx cannot be determined", "pan the camera as well"};
  }
  if (config.rotation == RotationKnowledge::free) {
    std::string hold;
    if (!config.square_pixels) hold = " --square-pixels";
    if (!config.fixed_centre) hold += " --fix-centre";
    return {"free rotation", "with the rotation unknown these views cannot determine fx / fy, cx and cy apart",
            "measure the rotation, rotate the camera farther, about its axis of view too" +
                (hold.empty() ? "" : ", or fix them:" + hold)};
  }
  if (report.motion.span_rad < 3.0 * degree) {
    if (const auto narrow = narrow_field(report, config)) return *narrow;
    return {"too small a span",
            "too small a span: the camera rotates by " + text_of(report.motion.span_rad / degree, 2) + "° only",
            "pan and tilt by 5° or more"};
  }
  if (log.num_points < 2)
    return {"too few points", "too few points: one does not determine them", "track four or more"};
  return {"weak motion", "the motion is too weak for the noise", "rotate farther, longer, or track more points"};
}

/// The worst determined combination of fx, fy, cx, cy: its σ [px] and its name.
Check weakest(const ObserveSolution& report) {
  Check check{"weakest combination", State::good, "", 0.0, 0.0, "px", "excitation"};
  const double s = report.scale.scale;
  const CommonMatrix bound = report.reference.solution.bound();
  const Eigen::Matrix4d K = bound.topLeftCorner<4, 4>() * s * s;
  if (!K.allFinite() || (K.diagonal().array() <= 0.0).any()) {
    check.state = State::refused;
    check.text = "no bound";
    return check;
  }
  const SymmetricEigen eigen = symmetric_eigen(K);
  const Eigen::Vector4d direction = eigen.vectors.col(3);
  static const char* const names[] = {"fx", "fy", "cx", "cy"};
  for (int i = 0; i < 4; ++i) {
    if (std::abs(direction[i]) < 0.3) continue;
    check.text += (check.text.empty()   ? ""
                   : direction[i] > 0.0 ? " + "
                                        : " − ") +
                  text_of(std::abs(direction[i]), 2) + " " + names[i];
  }
  check.value = std::sqrt(eigen.values[3]);
  check.limit = 0.05 * report.width_px;
  check.text += " is known to " + text_of(check.value, 2) + " px (1σ)";
  if (check.value > check.limit) check.state = State::refused;
  return check;
}

void add_checks(const ObserveSolution& report, Verdict& verdict) {
  verdict.checks.push_back(weakest(report));
  const double f_sigma = std::max(report.quantities[0].sigma / report.quantities[0].value,
                                  report.quantities[1].sigma / report.quantities[1].value);
  constexpr double none = 0.05;  // no usable answer
  verdict.checks.push_back({"focal length",
                            f_sigma < fine   ? State::good
                            : f_sigma < none ? State::care
                                             : State::bad,
                            "σ of the focal length is " + text_of(100.0 * f_sigma, 2) + " %", 100.0 * f_sigma,
                            100.0 * fine, "%", "intrinsics"});
  if (report.nis_per_dof > 0.0) {
    const bool fits = report.nis_per_dof > 0.5 && report.nis_per_dof < 2.0;
    verdict.checks.push_back({"consistent", fits ? State::good : State::care,
                              "innovations are " + text_of(std::sqrt(report.nis_per_dof), 2) + " times their σ",
                              report.nis_per_dof, 2.0, "", "nis"});
  }
  for (const Check& check : residual_checks(report)) verdict.checks.push_back(check);
  verdict.checks.insert(verdict.checks.end(), report.side_checks.begin(), report.side_checks.end());
  if (report.gramian_lambda_min >= 0.0) {
    const double lambda = report.gramian_lambda_min;
    const State state = lambda < fang_refuse_lambda ? State::refused
                        : lambda < fang_warn_lambda ? State::care
                                                    : State::good;
    verdict.checks.push_back({"persistent excitation", state,
                              "least eigenvalue of the observer's Gramian " + text_of(lambda, 2), lambda,
                              fang_refuse_lambda, "", "excitation"});
  }
}

Verdict refusal(const std::string& sentence, const std::string& add, ExitCode code) {
  Verdict verdict;
  verdict.state = code == ExitCode::undetermined ? State::refused : State::not_converged;
  verdict.exit_code = code;
  verdict.sentence = sentence;
  verdict.to_add = add;
  return verdict;
}

Verdict fang_refusal(const ObserveSolution& report, const RotationLog& log, const Reason& reason) {
  std::string why = "the paper's observer is not excited: least eigenvalue of its Gramian " +
                    text_of(report.gramian_lambda_min, 2) + " < 1e-4";
  if (log.num_points < 3)
    why = "too few points for the paper's observer: " + std::to_string(log.num_points) + ", it needs three";
  std::string add = "use --method hybrid, which determines it from this log";
  if (reason.name == "too small a span") std::tie(why, add) = std::pair(reason.what, reason.add);
  Verdict verdict = refusal(why, add, ExitCode::undetermined);
  add_checks(report, verdict);
  return verdict;
}

/// The principal point is near the centre of the image, unless the image has another size than given, or is cropped.
void add_size_check(const ObserveSolution& report, const ObserveSetup& config, Verdict& verdict) {
  constexpr double most = 0.1, clearly = 5.0;
  if (config.width_px <= 0 || config.fixed_centre) return;
  double off = 0.0;
  std::string where;
  for (const int axis : {0, 1}) {
    const ObservedQuantity& centre = report.quantities[2 + static_cast<std::size_t>(axis)];
    const double size = axis == 0 ? config.width_px : config.height_px, away = centre.value - 0.5 * (size - 1.0);
    if (std::abs(away) < clearly * centre.sigma || std::abs(away) / size < off) continue;
    off = std::abs(away) / size;
    where = centre.name + " is " + text_of(100.0 * off, 2) + " % of the " + (axis == 0 ? "width" : "height") +
            " from the centre of a " + std::to_string(config.width_px) + "x" + std::to_string(config.height_px) +
            " image";
  }
  const bool is_far = off > most;
  verdict.checks.push_back({.name = "image size",
                            .state = is_far ? State::care : State::good,
                            .text = is_far ? where + ": are the pixels of images of that size, and not cropped?"
                                           : "the principal point is near the image centre",
                            .value = 100.0 * off,
                            .limit = 100.0 * most,
                            .unit = "%"});
}

/// A scale that no instrument has is not an error of measurement: the angles have another meaning.
void add_scale_check(const ObserveSolution& report, Verdict& verdict) {
  constexpr double most = 0.1;
  for (const ObservedQuantity& quantity : report.quantities) {
    if (!quantity.name.starts_with("scale_") || std::abs(quantity.value) <= most) continue;
    const std::string reading = quantity.value > 0.0 ? "the angles are half of what the head turns"
                                                     : "the angles are twice what the head turns";
    verdict.checks.push_back({.name = "rotation read as it is",
                              .state = State::bad,
                              .text = "no encoder is off by " + text_of(100.0 * std::abs(quantity.value), 2) +
                                      " %: " + reading + ", or of another unit",
                              .value = std::abs(quantity.value),
                              .limit = most,
                              .unit = "1"});
    return;
  }
}

/// Why there is no estimate, as a verdict; none if there is an estimate.
std::optional<Verdict> refusal_of(const ObserveSolution& report, const RotationLog& log, const ObserveSetup& config) {
  using Status = ObserveSolution::Status;
  if (report.status == Status::unobservable || report.status == Status::too_few_data) {
    Reason reason = reason_of(report, log, config);
    if (!report.misread.empty()) {
      reason.what = "the rotation does not fit these pixels, and would if it were read otherwise";
      reason.add = report.misread;
    }
    Verdict verdict = refusal(reason.what, reason.add, ExitCode::undetermined);
    if (report.status == Status::unobservable) verdict.checks.push_back(weakest(report));
    return verdict;
  }
  if (report.status == Status::focal_length_varies) {
    const bool is_hybrid = config.method == ObserveMethod::hybrid;
    return refusal(is_hybrid ? "the focal length never rests: there is no second to estimate the points in"
                             : "the focal length changes within this log: one camera is no answer",
                   is_hybrid ? "let the zoom rest for a second or two while the camera pans and tilts, then zoom"
                             : "use --method hybrid, which follows a zoom",
                   ExitCode::undetermined);
  }
  if (report.status == Status::no_convergence) {
    // The adjustment found no minimum, on a log that is degenerate anyway.
    const Reason reason = reason_of(report, log, config);
    if (reason.name != "weak motion") {
      return refusal(reason.what, reason.add, ExitCode::undetermined);
    }
    if (!report.misread.empty()) {
      return refusal("no intrinsics explain these pixels with this rotation, but they fit once it is read otherwise",
                     report.misread, ExitCode::no_convergence);
    }
    return refusal("no intrinsics explain these pixels with this rotation",
                   "check the axes and units of the rotation, that the points are static, and the zoom for a second",
                   ExitCode::no_convergence);
  }
  if (config.method == ObserveMethod::fang2011 && report.gramian_lambda_min >= 0.0 &&
      report.gramian_lambda_min < fang_refuse_lambda) {
    return fang_refusal(report, log, reason_of(report, log, config));
  }
  return std::nullopt;
}

/// "fx 700.1 ± 0.5 px, fy …", with 3σ.
std::string sentence_of(const ObserveSolution& report) {
  const ObservedQuantity &fx = report.quantities[0], &fy = report.quantities[1];
  return "fx " + text_of(fx.value, 5) + " ± " + text_of(3.0 * fx.sigma, 2) + " px, fy " + text_of(fy.value, 5) + " ± " +
         text_of(3.0 * fy.sigma, 2) + " px (3σ) from " + std::to_string(report.rows_used) + " rows";
}

/// Takes the state of the worst check, and its text as what to add.
void adopt_worst_check(Verdict& verdict) {
  for (const Check& check : verdict.checks) {
    const bool speaks = check.state == State::care || check.state == State::bad;
    if (!speaks || check.state <= verdict.state) continue;
    verdict.state = check.state;
    verdict.to_add = check.text;
  }
}

/// Advice from the more specific checks first: misplaced images, a cause, noise of the rotation; and the check for a
/// misread rotation.
void add_advice(const ObserveSolution& report, Verdict& verdict) {
  // A large σ of the focal length is a consequence, not a cause.
  const bool has_other = std::ranges::any_of(
      verdict.checks, [](const Check& check) { return check.state == State::bad && check.name != "focal length"; });
  const bool may_advise = verdict.state == State::care || (verdict.state == State::bad && !has_other);
  const auto advise = [&](const auto& is_it) {
    const auto it = std::ranges::find_if(verdict.checks, is_it);
    if (it != verdict.checks.end() && may_advise) verdict.to_add = it->text;
  };
  advise([](const Check& check) { return check.name == "rotation's noise" && check.state == State::care; });
  advise([](const Check& check) { return check.name.starts_with("needs "); });
  advise([](const Check& check) { return check.name == frames_check; });
  const Check read = rotation_check(report);
  verdict.checks.push_back(read);
  if (read.state == State::bad) {
    verdict.state = State::bad;
    verdict.to_add = read.text;
  }
}

}  // namespace

Verdict observe_verdict(const ObserveSolution& report, const RotationLog& log, const ObserveSetup& config) {
  if (std::optional<Verdict> refused = refusal_of(report, log, config)) return *std::move(refused);
  Verdict verdict;
  add_checks(report, verdict);
  add_scale_check(report, verdict);
  add_size_check(report, config, verdict);
  adopt_worst_check(verdict);
  verdict.sentence = sentence_of(report);
  if (report.sigma_is_distance) {
    heed({"σ", State::care, "the method states no σ: it is the distance from the adjustment of all rows", 0.0, 0.0, "",
          "intrinsics"},
         "use --method hybrid for a σ of its own", verdict);
  }
  add_advice(report, verdict);
  heed_assumptions(report.assumed, verdict);
  return verdict;
}

}  // namespace alidade
