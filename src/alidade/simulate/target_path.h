#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <vector>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

enum class PathKind { still, circle, sway, step, manoeuvre, recorded };
[[nodiscard]] std::string_view path_name(PathKind kind);  ///< still, circle, sway, step, manoeuvre, recorded
/// The kind with that name; all but `recorded`, which needs its record.
[[nodiscard]] std::optional<PathKind> path_named(std::string_view name);

/// Path of a target. A circle lies in a plane of constant z and begins at `start`, with its centre at −x of it; a sway
/// is a lateral oscillation about `start`; a step leaves `start` for good at a given time; a manoeuvre is
/// manoeuvre_position(); a recorded path interpolates its positions by cubics (Hermite's, with the slopes of parabolas)
/// and is constant before and after.
struct TargetPath {
  PathKind kind = PathKind::circle;
  Eigen::Vector3d start_m{0.173, -0.314, 0.636};  ///< In the world: the initial position of Xiahou, Chen & Wu, 2015.
  double radius_m = 0.1;                          ///< Also the amplitude of a sway.
  double period_s = 10.0;
  Eigen::Vector3d jump_m{0.25, 0.12, 0.0};
  double jump_at_s = 1.0;
  std::vector<double> recorded_s;  ///< Ascending.
  std::vector<Eigen::Vector3d> recorded_m;

  [[nodiscard]] Eigen::Vector3d at(double t_s) const;
};

/// Focal lengths over time, as factors of a camera's own: linear in the logarithm between the times, constant before
/// the first and after the last. Without times the factor is constant.
struct ZoomProfile {
  std::vector<double> t_s;  ///< Ascending.
  std::vector<double> factor;

  [[nodiscard]] double at(double at_s) const;
  [[nodiscard]] double largest() const;
  [[nodiscard]] bool is_still() const;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
