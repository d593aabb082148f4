#include "alidade/reproduce/fang_scenes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/observe/filters/flow_regressor.h"
#include "alidade/simulate/draws.h"

namespace alidade::reproduce {
namespace {

/// Whether no triangle among the points is lower.
bool are_at_least_high(const std::vector<Eigen::Vector2d>& p, double height_px) {
  for (std::size_t i = 0; i < p.size(); ++i) {
    for (std::size_t j = i + 1; j < p.size(); ++j) {
      for (std::size_t k = j + 1; k < p.size(); ++k) {
        const Eigen::Vector2d ab = p[j] - p[i], ac = p[k] - p[i];
        const double area2 = std::abs(ab.x() * ac.y() - ab.y() * ac.x());
        if (area2 < height_px * std::max({ab.norm(), ac.norm(), (p[k] - p[j]).norm()})) return false;
      }
    }
  }
  return true;
}

bool is_within(double t_s, double from_s, double to_s) { return t_s > from_s - 1e-9 && t_s < to_s + 1e-9; }

}  // namespace

FangConfig paper_config(FangProfile profile) {
  FangConfig config;
  config.num_points = 4;
  config.scale = paper_scale;
  config.profile = profile;
  config.start = paper_start;
  config.roll_columns = false;
  return config;
}

HybridObserver paper_hybrid() {
  HybridConfig config;
  config.num_points = 4;
  config.scale = paper_scale;
  config.start.k = paper_scale.normalised_intrinsics(paper_start);
  config.start_is_given = true;
  config.sigma_px = paper_sigma_px;  // given: there are logs without any noise to estimate it from
  return HybridObserver(config);
}

RotationScene paper_scene(std::vector<Eigen::Vector2d> start_px) {
  RotationScene scene;
  scene.start_px = std::move(start_px);
  scene.motion = paper_rate;
  return scene;
}

std::vector<Eigen::Vector2d> draw_set(std::uint64_t seed, int num_points) {
  Draws draws(seed);
  for (;;) {
    std::vector<Eigen::Vector2d> points;
    for (int i = 0; i < num_points; ++i) {
      const double x = draws.uniform(60.0, 720.0), y = draws.uniform(60.0, 522.0);
      points.emplace_back(x, y);
    }
    if (are_at_least_high(points, 40.0)) return points;
  }
}

void add_paper_noise(RotationLog& log, std::uint64_t seed) {
  Draws draws(seed);
  for (RotationRow& row : log.rows)
    for (std::size_t i = 0; i < row.px.size(); ++i) row.px[i][i % 2] += paper_sigma_px * draws.normal();
}

void add_burst(RotationLog& log, std::size_t row, std::uint64_t seed) {
  Draws draws(seed);
  for (Eigen::Vector2d& px : log.rows[row].px) px += 3.0 * draws.normal2();
}

Eigen::Vector4d zooming(double t_s) { return (paper_truth.array() + 6.0 * std::clamp(t_s - 6.0, 0.0, 4.0)).matrix(); }

RotationLog zoom_log(const std::vector<Eigen::Vector2d>& start_px) {
  RotationScene scene = paper_scene(start_px);
  scene.intrinsics = [](double t_s) {
    const Eigen::Vector4d k = zooming(t_s);
    return RotatingIntrinsics{k[0], k[1], k[2], k[3]};
  };
  return simulate_rotation(scene, {.sigma_px = 0.0}, 1);
}

RotationLog flow_only_zoom_log(const std::vector<Eigen::Vector2d>& start_px) {
  RotationLog log;
  log.num_points = start_px.size();
  log.rows.resize(601);
  log.truth.resize(601);
  std::vector<Eigen::Vector2d> q;
  for (const Eigen::Vector2d& px : start_px) q.push_back(paper_scale.normalised(px));
  constexpr int num_substeps = 8;
  constexpr double h = 1.0 / (30.0 * num_substeps);
  const auto flow = [](const Eigen::Vector2d& at, double t_s) {
    const FlowParameters theta = flow_parameters(scaled_intrinsics(paper_scale, zooming(t_s)));
    return Eigen::Vector2d(flow_regressor(at, paper_rate(t_s)).transpose() * theta);
  };
  for (std::size_t r = 0; r < log.rows.size(); ++r) {
    RotationRow& row = log.rows[r];
    row.t_s = static_cast<double>(r) / 30.0;
    row.rate_rad_per_s = paper_rate(row.t_s);
    Eigen::Map<Eigen::Vector4d>(log.truth[r].data()) = zooming(row.t_s);
    for (Eigen::Vector2d& at : q) {
      row.px.push_back(paper_scale.scale * at + paper_scale.centre);
      for (int i = 0; i < num_substeps; ++i) {  // Runge and Kutta's rule of fourth order
        const double t_s = row.t_s + i * h;
        const Eigen::Vector2d a = flow(at, t_s), b = flow(at + 0.5 * h * a, t_s + 0.5 * h),
                              c = flow(at + 0.5 * h * b, t_s + 0.5 * h), d = flow(at + h * c, t_s + h);
        at += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
      }
    }
  }
  return log;
}

Eigen::Matrix<double, 8, 8> mean_gramian_of(const RotationLog& clean) {
  using Matrix8 = Eigen::Matrix<double, 8, 8>;
  std::size_t reference = 0;
  for (std::size_t i = 0; i < clean.num_points; ++i) {
    if ((clean.rows[0].px[i] - paper_scale.centre).norm() < (clean.rows[0].px[reference] - paper_scale.centre).norm())
      reference = i;
  }
  Matrix8 sum = Matrix8::Zero();
  double count = 0.0;
  for (const RotationRow& row : clean.rows) {
    if (row.t_s > 7.854) break;  // one period of the motion
    for (std::size_t i = 0; i < clean.num_points; ++i) {
      const DifferenceRegressor omega = difference_regressor(
          paper_scale.normalised(row.px[i]), paper_scale.normalised(row.px[reference]), row.rate_rad_per_s);
      sum += omega * omega.transpose();
    }
    ++count;
  }
  return sum / count + 1e-6 * Matrix8::Identity();
}

Eigen::Vector4d error_px(const RotationLog& log, const std::vector<IntrinsicsEstimate>& estimates, std::size_t r) {
  if (!estimates[r].has_value) return Eigen::Vector4d::Constant(std::numeric_limits<double>::infinity());
  return estimates[r].values() - Eigen::Map<const Eigen::Vector4d>(log.truth[r].data());
}

double settle_s(const RotationLog& log, const std::vector<IntrinsicsEstimate>& estimates, double share, double from_s,
                double to_s) {
  double settled_s = from_s;
  for (std::size_t r = 0; r < log.rows.size(); ++r) {
    if (!is_within(log.rows[r].t_s, from_s, to_s)) continue;
    const Eigen::Map<const Eigen::Array4d> truth(log.truth[r].data());
    if ((error_px(log, estimates, r).array().abs() > share * truth).any()) settled_s = log.rows[r].t_s;
  }
  return settled_s - from_s;
}

Eigen::Vector4d rms_px(const RotationLog& log, const std::vector<IntrinsicsEstimate>& estimates, double from_s,
                       double to_s) {
  Eigen::Array4d sum = Eigen::Array4d::Zero();
  double count = 0.0;
  for (std::size_t r = 0; r < log.rows.size(); ++r) {
    if (!is_within(log.rows[r].t_s, from_s, to_s)) continue;
    sum += error_px(log, estimates, r).array().square();
    ++count;
  }
  return (sum / count).sqrt();
}

}  // namespace alidade::reproduce
