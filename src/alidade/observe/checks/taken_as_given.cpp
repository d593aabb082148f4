#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/observe/solve/solve.h"

namespace alidade {
namespace {

constexpr const char* const quantity_names[] = {"fx", "fy", "cx", "cy"};

/// Typical errors of a cause for which no σ is given.
struct Given {
  std::string cause;
  double ordinary;
  std::optional<double> ObserveSetup::*config_sigma;
  const char* remedy;
  bool is_counted = false;  ///< If no σ is given: count the typical size, as far as the residuals allow it.
  double as_scale = 0.0;  ///< σ of the scale of the rotation to which one unit corresponds, over the angles of a log.
  double least = 0.0;     ///< No instrument is better: below it, the residuals limit an error of this size.
};

constexpr double ordinary_scale = 0.005, ordinary_mount_rad = 0.5 * degree, ordinary_delay_s = 0.01,
                 ordinary_parallax = 0.002,  // 1 cm at 5 m
    ordinary_k1 = 0.02, ordinary_centre_px = 2.0, ordinary_curve_rad = 0.05 * degree,
                 ordinary_clock_rate = 0.001;  // 29.97 frames per second mistaken for 30
constexpr const char* clock_cause = "clock rate";
constexpr const char* curve_cause = "error of the angles within a turn";
constexpr double bend_of_rates = 0.001;        // the scale of a gyroscope varies that much with the rate
const double slope_of_waves = std::sqrt(5.0);  // once and twice per revolution, sine and cosine

const std::vector<Given>& givens() {
  static const std::vector<Given> all{
      {"encoder scale", ordinary_scale, &ObserveSetup::sigma_scale, "give --sigma-encoder-scale"},
      {.cause = "scale of the rates",
       .ordinary = ordinary_scale,
       .config_sigma = &ObserveSetup::sigma_scale,
       .remedy = "give --sigma-encoder-scale",
       .least = bend_of_rates},
      {"lever", ordinary_parallax, &ObserveSetup::sigma_parallax,
       "give --sigma-parallax, or --lever with measured ranges"},
      {"mount", ordinary_mount_rad, nullptr, "--estimate mount", true},
      {"delay", ordinary_delay_s, nullptr, "--estimate delay", true},
      {"k1", ordinary_k1, &ObserveSetup::sigma_k1, "--estimate k1, or give a camera file with its covariance", true},
      {curve_cause, ordinary_curve_rad, nullptr, "--estimate curve", true, slope_of_waves},
      {clock_cause, ordinary_clock_rate, nullptr, "--estimate clock", true, 1.0}};
  return all;
}

/// A log with a truth whose scale and centre are exact comes from a simulator: all else that it omits is exact as well.
bool is_exact(const RotationLog& log) {
  return !log.truth.empty() && log.sigma_scale == 0.0 && log.sigma_parallax == 0.0;
}

std::optional<double> given_sigma(const Given& given, const RotationLog& log, const ObserveSetup& config) {
  if (given.config_sigma != nullptr && config.*given.config_sigma) return config.*given.config_sigma;
  if (given.config_sigma == &ObserveSetup::sigma_scale) return log.sigma_scale;
  if (given.config_sigma == &ObserveSetup::sigma_parallax) return log.sigma_parallax;
  return is_exact(log) ? std::optional(0.0) : std::nullopt;
}

/// Over so few degrees, a wave of one period per revolution is a straight line: an error of scale, listed already.
bool is_straight_line(const RotationLog& log) {
  constexpr double short_rad = 0.1;
  if (log.source != RotationSource::head || log.rows.empty()) return false;
  Eigen::Array3d low = log.rows.front().pan_tilt_roll_rad.array(), high = low;
  for (const RotationRow& row : log.rows) {
    low = low.min(row.pan_tilt_roll_rad.array());
    high = high.max(row.pan_tilt_roll_rad.array());
  }
  return (high - low).maxCoeff() < short_rad;
}

/// Typical size beyond the error of scale, which a given σ of the scale covers already.
double ordinary_beside_scale(const Given& given, const RotationLog& log, const ObserveSetup& config) {
  const bool is_scale = given.as_scale > 0.0 && (given.cause != clock_cause || log.source == RotationSource::rate);
  if (!is_scale) return given.ordinary;
  const double counted = (config.sigma_scale ? config.sigma_scale : log.sigma_scale).value_or(0.0) / given.as_scale;
  return std::sqrt(std::max(0.0, given.ordinary * given.ordinary - counted * counted));
}

std::string full_name(const std::string& cause, const CauseMember& member) {
  if (cause == member.name) return cause;
  return cause + " " + member.name;
}

/// Fills in the effect of moving fx, fy, cx, cy by `move`.
void fill_effect(const Eigen::Vector4d& move, const Eigen::Vector4d& sigma, double scale, Assumption& assumption) {
  Eigen::Index worst = 0;
  assumption.moves = move.cwiseAbs().cwiseQuotient(sigma).maxCoeff(&worst);
  assumption.moved = quantity_names[worst];
  assumption.moved_by = std::abs(move[worst]) * scale;
}

/// A lever appears as one parallax along the view common to all points; parallax of some points shows in the residuals.
std::size_t first_member(const std::string& cause) { return cause == "lever" ? 2 : 0; }
std::size_t end_member(const CauseScore& cause) {
  return cause.name == "lever" ? std::min<std::size_t>(3, cause.members.size()) : cause.members.size();
}

/// Adds the effect on the parameters of a typical error of the cause, as far as these residuals allow it.
void count_ordinary(const CauseScore& cause, double ordinary, CommonMatrix& cov) {
  const auto m = static_cast<Eigen::Index>(cause.members.size()), n = cause.members.front().moves.size();
  if (n > cov.rows() || cause.information.rows() != m) return;
  Eigen::MatrixXd moves(n, m);
  Eigen::VectorXd value(m);
  for (Eigen::Index i = 0; i < m; ++i) {
    moves.col(i) = cause.members[static_cast<std::size_t>(i)].moves;
    value[i] = cause.members[static_cast<std::size_t>(i)].value;
  }
  const Eigen::MatrixXd before = Eigen::MatrixXd::Identity(m, m) / (ordinary * ordinary);
  const Eigen::MatrixXd left = inverse_symmetric(cause.information + before);
  Eigen::MatrixXd scatter = moves * left * moves.transpose();
  // The error that the residuals indicate, though within chance, is certainly possible.
  const Eigen::VectorXd asked = moves * (left * (cause.information * value));
  constexpr double hardly = 2.0;
  if (cause.z > hardly) scatter += asked * asked.transpose();
  cov.topLeftCorner(n, n) += scatter;
}

void count_given(const CauseMember& member, double sigma, CommonMatrix& cov) {
  const auto n = member.moves.size();
  if (n <= cov.rows()) cov.topLeftCorner(n, n) += sigma * sigma * member.moves * member.moves.transpose();
}

/// Causes that the residuals indicate, but not enough to be estimated: the answer may be off by their effect.
void count_asked(const ObserveSolution& report, CommonMatrix& cov) {
  constexpr double hardly = 3.0;
  for (const CauseScore& cause : report.causes) {
    const Eigen::Index n = cause.shift.size();
    if (cause.z < hardly || cause.z >= asked_beyond(report) || n > cov.rows()) continue;
    cov.topLeftCorner(n, n) += cause.shift * cause.shift.transpose();
  }
}

/// Effect on fx and fy of fixing the principal point at a wrong place.
void add_fixed_centre(const ObserveSetup& config, const ObserveSolution& report, const Eigen::Vector4d& sigma,
                      std::vector<Assumption>& assumed) {
  if (!config.fixed_centre) return;
  const CommonMatrix& information = report.reference.solution.information;
  const CommonMatrix& said = report.reference.solution.given_information;
  const Eigen::Matrix2d free = (information + said).topLeftCorner<2, 2>();
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d pull = -information.block<2, 1>(0, 2 + axis) * (ordinary_centre_px / report.scale.scale);
    Eigen::Vector4d move = Eigen::Vector4d::Zero();
    move.head<2>() = solve_symmetric(free, pull);
    Assumption assumption{
        .name = axis == 0 ? "cx fixed" : "cy fixed",
        .value = report.quantities.empty() ? not_seen : report.quantities[2 + static_cast<std::size_t>(axis)].value,
        .ordinary = ordinary_centre_px,
        .remedy = "calibrate with a board, or measure the rotation: then the centre need not be fixed"};
    fill_effect(move, Eigen::Vector4d(sigma[0], sigma[1], 1.0, 1.0), report.scale.scale, assumption);
    assumed.push_back(assumption);
  }
}

/// One row for changes of a zoom lens other than those of focal length and centre. It does not affect the verdict.
void add_zoomed_lens(const ObserveSolution& report, std::vector<Assumption>& assumed) {
  constexpr double clearly_zoomed = 1.02;
  double least = std::numeric_limits<double>::infinity(), most = 0.0;
  bool has_zoomed = false;
  for (const IntrinsicsEstimate& row : report.steps) {
    has_zoomed = has_zoomed || row.event == ObserveEvent::zoom;
    if (!row.has_value || row.event == ObserveEvent::burst) continue;
    least = std::min(least, row.fx);
    most = std::max(most, row.fx);
  }
  if (!has_zoomed || most < clearly_zoomed * least) return;
  Assumption row{.name = "zoom.not_tested",
                 .value = most / least,
                 .moved =
                     "fx, fy, cx, cy: distortion and mounting are taken as the same at every zoom; what of them "
                     "goes with it shows only where it is large"};
  row.sigma = 0.0;
  row.moves = std::nan("");
  assumed.push_back(row);
}

}  // namespace

std::vector<Assumption> taken_as_given(const RotationLog& log, const ObserveSetup& config,
                                       const ObserveSolution& report, CommonMatrix& cov) {
  std::vector<Assumption> assumed;
  struct Effect {
    std::size_t assumption;
    Eigen::Vector4d move;
  };
  std::vector<Effect> effects;
  for (const Given& given : givens()) {
    const auto cause = std::find_if(report.causes.begin(), report.causes.end(),
                                    [&](const CauseScore& each) { return each.name == given.cause; });
    if (cause == report.causes.end() || (given.cause == curve_cause && is_straight_line(log))) continue;
    std::optional<double> sigma = given_sigma(given, log, config);
    const bool is_counted = !sigma && given.is_counted && !cause->members.empty();
    const double ordinary = ordinary_beside_scale(given, log, config);
    if (is_counted && ordinary > 0.0) count_ordinary(*cause, ordinary, cov);
    if (sigma && *sigma < given.least && !is_exact(log))
      count_ordinary(*cause, std::sqrt(given.least * given.least - *sigma * *sigma), cov);
    for (std::size_t i = first_member(cause->name); i < end_member(*cause); ++i) {
      const CauseMember& member = cause->members[i];
      Assumption assumption{.name = full_name(cause->name, member), .sigma = sigma, .remedy = given.remedy};
      if (is_counted) assumption.sigma = ordinary;
      if (!sigma) assumption.ordinary = member.sigma > 0.0 ? std::min(ordinary, member.sigma) : ordinary;
      const double error = sigma ? *sigma : assumption.ordinary;
      if (sigma) count_given(member, error, cov);
      effects.push_back({assumed.size(), error * member.moves.head<4>()});
      assumed.push_back(assumption);
    }
  }
  count_asked(report, cov);
  const Eigen::Vector4d stated = cov.diagonal().head<4>().cwiseSqrt();
  for (const Effect& effect : effects) {
    fill_effect(effect.move, stated, report.scale.scale, assumed[effect.assumption]);
  }
  add_fixed_centre(config, report, stated, assumed);
  add_zoomed_lens(report, assumed);
  return assumed;
}

void count_left(const CauseScore* left, const std::vector<RotationError>& errors, ObserveSolution& report) {
  const Eigen::Index n = left == nullptr ? 0 : left->shift.size();
  if (n < 4 || n > report.covariance.rows() || n > std::ssize(report.quantities)) return;
  Eigen::VectorXd shift = left->shift;
  shift.head<4>() *= report.scale.scale;
  for (Eigen::Index i = 4; i < n; ++i)
    for (const RotationError& error : errors)
      if (report.quantities[static_cast<std::size_t>(i)].name == error.quantity) shift[i] *= error.ordinary;
  report.covariance.topLeftCorner(n, n) += shift * shift.transpose();
  for (Eigen::Index i = 0; i < n; ++i)
    report.quantities[static_cast<std::size_t>(i)].sigma = std::sqrt(report.covariance(i, i));
  for (IntrinsicsEstimate& row : report.steps)
    row.sigma = (row.sigma.cwiseAbs2() + shift.head<4>().cwiseAbs2()).cwiseSqrt().eval();
}

void add_assumed(const std::vector<Assumption>& assumed, const std::vector<CauseScore>& causes, CommonMatrix& cov) {
  const auto sigma_of = [&](const CauseScore& cause, const CauseMember& member) {
    const auto found = std::ranges::find(assumed, full_name(cause.name, member), &Assumption::name);
    return found == assumed.end() ? 0.0 : found->sigma.value_or(0.0);
  };
  for (const Given& given : givens()) {
    const auto cause = std::ranges::find(causes, given.cause, &CauseScore::name);
    if (cause == causes.end() || cause->members.empty()) continue;
    if (given.is_counted) {
      const double sigma = sigma_of(*cause, cause->members.front());
      if (sigma > 0.0) count_ordinary(*cause, sigma, cov);
      continue;
    }
    for (std::size_t i = first_member(cause->name); i < end_member(*cause); ++i) {
      const CauseMember& member = cause->members[i];
      const double sigma = sigma_of(*cause, member);
      if (sigma > 0.0) count_given(member, std::max(sigma, given.least), cov);
    }
  }
}

}  // namespace alidade
