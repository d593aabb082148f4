#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/observe/solve/solve.h"

namespace alidade {
namespace {

constexpr const char* const quantity_names[] = {"fx", "fy", "cx", "cy"};

/// How errors of a cause that nobody told a σ of ordinarily are.
struct Given {
  const char* cause;
  double ordinary;
  std::optional<double> ObserveSetup::*told;
  const char* remedy;
  bool is_counted = false;  ///< Where no σ is told: as it ordinarily is, less what the residuals say.
};

constexpr double ordinary_scale = 0.005, ordinary_mount_rad = 0.5 * degree, ordinary_delay_s = 0.01,
                 ordinary_parallax = 0.002,  // 1 cm at 5 m
    ordinary_k1 = 0.02, ordinary_centre_px = 2.0;

const std::vector<Given>& givens() {
  static const std::vector<Given> all{
      {"encoder scale", ordinary_scale, &ObserveSetup::sigma_scale, "give --sigma-encoder-scale"},
      {"scale of the rates", ordinary_scale, &ObserveSetup::sigma_scale, "give --sigma-encoder-scale"},
      {"lever", ordinary_parallax, &ObserveSetup::sigma_parallax,
       "give --sigma-parallax, or --lever with measured ranges"},
      {"mount", ordinary_mount_rad, nullptr, "--estimate mount", true},
      {"delay", ordinary_delay_s, nullptr, "--estimate delay", true},
      {"k1", ordinary_k1, &ObserveSetup::sigma_k1, "--estimate k1, or give a camera file with its covariance", true}};
  return all;
}

std::optional<double> told_sigma(const Given& given, const RotationLog& log, const ObserveSetup& config) {
  if (given.told != nullptr && config.*given.told) return config.*given.told;
  if (given.told == &ObserveSetup::sigma_scale) return log.sigma_scale;
  if (given.told == &ObserveSetup::sigma_parallax) return log.sigma_parallax;
  // A log whose scale and centre are exact comes from a simulator: so is all that it does not say.
  if (log.sigma_scale == 0.0 && log.sigma_parallax == 0.0) return 0.0;
  return std::nullopt;
}

std::string full_name(const std::string& cause, const CauseMember& member) {
  if (cause == member.name) return cause;
  return cause + " " + member.name;
}

/// fx, fy, cx, cy moved by so much.
void fill_effect(const Eigen::Vector4d& move, const Eigen::Vector4d& sigma, double scale, Assumption& assumption) {
  Eigen::Index worst = 0;
  assumption.moves = move.cwiseAbs().cwiseQuotient(sigma).maxCoeff(&worst);
  assumption.moved = quantity_names[worst];
  assumption.moved_by = std::abs(move[worst]) * scale;
}

/// A lever shows as one parallax along the view that all points have: what only some have, the residuals tell.
std::size_t first_member(const std::string& cause) { return cause == "lever" ? 2 : 0; }
std::size_t end_member(const CauseScore& cause) {
  return cause.name == "lever" ? std::min<std::size_t>(3, cause.members.size()) : cause.members.size();
}

/// Adds what an error of a cause, as it ordinarily is and as these residuals let it be, does to the parameters.
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
  // What they ask for, though by less than chance allows, is not beyond what may be there.
  const Eigen::VectorXd asked = moves * (left * (cause.information * value));
  constexpr double hardly = 2.0;
  if (cause.z > hardly) scatter += asked * asked.transpose();
  cov.topLeftCorner(n, n) += scatter;
}

/// fx and fy follow a centre that is held where it is not.
void add_held_centre(const ObserveSetup& config, const ObserveSolution& report, const Eigen::Vector4d& sigma,
                     std::vector<Assumption>& assumed) {
  if (!config.fixed_centre) return;
  const CommonMatrix& information = report.reference.solution.information;
  const CommonMatrix& said = report.reference.solution.said_information;
  const Eigen::Matrix2d free = (information + said).topLeftCorner<2, 2>();
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d pull = -information.block<2, 1>(0, 2 + axis) * (ordinary_centre_px / report.scale.scale);
    Eigen::Vector4d move = Eigen::Vector4d::Zero();
    move.head<2>() = free.ldlt().solve(pull);
    Assumption assumption{
        .name = axis == 0 ? "cx held" : "cy held",
        .value = report.quantities.empty() ? not_seen : report.quantities[2 + static_cast<std::size_t>(axis)].value,
        .ordinary = ordinary_centre_px,
        .remedy = "calibrate with a board, or measure the rotation: then the centre need not be fixed"};
    fill_effect(move, Eigen::Vector4d(sigma[0], sigma[1], 1.0, 1.0), report.scale.scale, assumption);
    assumed.push_back(assumption);
  }
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
    if (cause == report.causes.end()) continue;
    std::optional<double> sigma = told_sigma(given, log, config);
    const bool is_counted = !sigma && given.is_counted && !cause->members.empty();
    if (is_counted) count_ordinary(*cause, given.ordinary, cov);
    for (std::size_t i = first_member(cause->name); i < end_member(*cause); ++i) {
      const CauseMember& member = cause->members[i];
      Assumption assumption{.name = full_name(cause->name, member), .sigma = sigma, .remedy = given.remedy};
      if (is_counted) assumption.sigma = given.ordinary;
      if (!sigma) assumption.ordinary = member.sigma > 0.0 ? std::min(given.ordinary, member.sigma) : given.ordinary;
      const double error = sigma ? *sigma : assumption.ordinary;
      if (sigma && member.moves.size() <= cov.rows()) {
        const auto n = member.moves.size();
        cov.topLeftCorner(n, n) += error * error * member.moves * member.moves.transpose();
      }
      effects.push_back({assumed.size(), error * member.moves.head<4>()});
      assumed.push_back(assumption);
    }
  }
  const Eigen::Vector4d stated = cov.diagonal().head<4>().cwiseSqrt();
  for (const Effect& effect : effects) {
    fill_effect(effect.move, stated, report.scale.scale, assumed[effect.assumption]);
  }
  add_held_centre(config, report, stated, assumed);
  return assumed;
}

}  // namespace alidade
