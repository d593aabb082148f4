#include "alidade/reproduce/fang_runs.h"

#include <array>
#include <cmath>

namespace alidade::reproduce {
namespace {

std::vector<double> column(const std::vector<IntrinsicsEstimate>& estimates, Eigen::Index parameter) {
  std::vector<double> values;
  for (const IntrinsicsEstimate& estimate : estimates)
    values.push_back(estimate.has_value ? estimate.values()[parameter] : not_a_number);
  return values;
}

std::vector<double> times_of(const RotationLog& log) {
  std::vector<double> t_s;
  for (const RotationRow& row : log.rows) t_s.push_back(row.t_s);
  return t_s;
}

}  // namespace

FangRun run_observer(const RotationLog& log, FangProfile profile, const RotationLog& planned) {
  FangConfig config = paper_config(profile);
  config.num_points = log.num_points;
  if (profile != FangProfile::kalman) config.mean_gramian = mean_gramian_of(planned);
  FangObserver observer(config);
  MotionReader reader(log.source, 0.5);
  FangRun run;
  const std::size_t num_states = 2 * log.num_points;  // of them two, the reference's, are zero
  run.errors_px.resize(num_states);
  for (const RotationRow& row : log.rows) {
    run.estimates.push_back(observer.step(reader.next(row)));
    double sum2 = 0.0;
    for (std::size_t i = 0; i < log.num_points; ++i) {
      const Eigen::Vector2d error = paper_scale.scale * observer.error(i);
      run.errors_px[2 * i].push_back(error.x());
      run.errors_px[2 * i + 1].push_back(error.y());
      sum2 += error.squaredNorm();
    }
    run.error_px.push_back(std::sqrt(sum2 / static_cast<double>(num_states - 2)));
  }
  return run;
}

FangRun run_hybrid(const RotationLog& log) {
  HybridObserver observer = paper_hybrid();
  return {observe_log(observer, log), {}, {}};
}

double errors_settle_s(const RotationLog& log, const FangRun& run, double limit_px) {
  double settled_s = 0.0;
  for (std::size_t r = 0; r < log.rows.size(); ++r)
    if (!(run.error_px[r] <= limit_px)) settled_s = log.rows[r].t_s;
  return settled_s;
}

std::vector<Eigen::Vector2d> figure_points() { return {{180.0, 120.0}, {640.0, 90.0}, {560.0, 400.0}, {220.0, 360.0}}; }

RotationLog clean_log(const std::vector<Eigen::Vector2d>& points) {
  return simulate_rotation(paper_scene(points), {.sigma_px = 0.0}, 1);
}

FigureTable errors_figure(const std::string& id, const RotationLog& log, const FangRun& ours) {
  FigureTable figure{id, {{"t_s", times_of(log)}}};
  int state = 0;
  for (const std::vector<double>& errors : ours.errors_px) {
    bool is_reference = true;
    for (const double error : errors) is_reference = is_reference && error == 0.0;
    if (!is_reference) figure.columns.emplace_back("error_" + std::to_string(++state) + "_px", errors);
  }
  return figure;
}

FigureTable intrinsics_figure(const std::string& id, const RotationLog& log, const FangRun& ours, const FangRun& best) {
  FigureTable figure{id, {{"t_s", times_of(log)}}};
  const std::array<std::string, 4> names{"fx", "fy", "u0", "v0"};
  for (Eigen::Index k = 0; k < 2; ++k) {
    const std::string& name = names[static_cast<std::size_t>(k)];
    std::vector<double> truth;
    for (const TrueIntrinsics& row : log.truth) truth.push_back(row[static_cast<std::size_t>(k)]);
    figure.columns.emplace_back("true_" + name + "_px", std::move(truth));
    figure.columns.emplace_back("ours_" + name + "_px", column(ours.estimates, k));
    figure.columns.emplace_back("best_" + name + "_px", column(best.estimates, k));
  }
  for (Eigen::Index k = 2; k < 4; ++k)
    figure.columns.emplace_back("ours_" + names[static_cast<std::size_t>(k)] + "_px", column(ours.estimates, k));
  return figure;
}

}  // namespace alidade::reproduce
