#include <algorithm>

#include "alidade/observe/solve/solve_once.h"

namespace alidade {

void add_turns(const RotationLog& log, const std::vector<RotationError>& errors, double max_gap_s,
               std::vector<RotationFrame>& frames) {
  const std::vector<TurnPattern> patterns = turn_patterns(log, errors, max_gap_s);
  for (std::size_t k = 0; k < frames.size() && !patterns.empty(); ++k) {
    frames[k].turn_by.resize(3, static_cast<Eigen::Index>(errors.size()));
    for (std::size_t i = 0; i < errors.size(); ++i) {
      frames[k].turn_by.col(static_cast<Eigen::Index>(i)) = errors[i].ordinary * patterns[i].turn_rad[k];
    }
  }
}

bool is_observable(const ObserveSolution& report, const CommonMatrix& bound) {
  constexpr double most = 0.05;  // share of the focal length; of the image width
  const Eigen::Vector4d& k = report.reference.solution.camera.k;
  const Eigen::Vector4d variance = bound.diagonal().head<4>();
  if (!(variance.array() > 0.0).all() || !variance.allFinite()) return false;
  const Eigen::Vector4d sigma = variance.cwiseSqrt();
  const double width = report.width_px / report.scale.scale;
  return sigma[0] < most * k[0] && sigma[1] < most * k[1] && sigma[2] < most * width && sigma[3] < most * width;
}

std::vector<RotationError> estimated_errors(const RotationLog& log, const ObserveSetup& config) {
  std::vector<RotationError> errors = rotation_errors(log.source, log.has_roll_rate);
  std::erase_if(errors, [&](const RotationError& error) {
    return std::find(config.estimate_errors.begin(), config.estimate_errors.end(), error.cause) ==
           config.estimate_errors.end();
  });
  const std::optional<double> sigma_scale = config.sigma_scale ? config.sigma_scale : log.sigma_scale;
  const auto is_scale = [](const RotationError& error) { return error.quantity.starts_with("scale"); };
  if (sigma_scale == 0.0) std::erase_if(errors, is_scale);
  for (RotationError& error : errors) {
    if (is_scale(error) && sigma_scale) error.ordinary = *sigma_scale;
  }
  return errors;
}

/// Errors of the rotation are small but non-linear (backlash acts at each reversal): the log is corrected for the
/// estimated errors, and solved again.
ObserveSolution solve_as_given(const RotationLog& log, const ObserveSetup& config, const Progress& progress) {
  const bool is_measured = config.rotation != RotationKnowledge::free;
  const std::vector<RotationError> errors = is_measured ? estimated_errors(log, config) : std::vector<RotationError>{};
  RotationErrors undone = RotationErrors::Zero(static_cast<Eigen::Index>(errors.size()));
  ObserveSolution report = solve_once(log, config, errors, undone, progress);
  constexpr int max_rounds = 4;
  constexpr double little = 0.02;  // of the typical size: below it, the remaining error is linear
  for (int round = 1; round < max_rounds && !errors.empty(); ++round) {
    if (report.status != ObserveSolution::Status::ok || report.errors.size() != undone.size()) break;
    if ((report.errors - undone).cwiseAbs().maxCoeff() < little) break;
    undone = report.errors;
    RotationLog freed = log;
    for (std::size_t i = 0; i < errors.size(); ++i) {
      errors[i].undo(freed.rows, undone[static_cast<Eigen::Index>(i)] * errors[i].ordinary);
    }
    ObserveSolution again = solve_once(freed, config, errors, undone, progress);
    if (again.status != ObserveSolution::Status::ok) break;
    report = std::move(again);
  }
  return report;
}

}  // namespace alidade
