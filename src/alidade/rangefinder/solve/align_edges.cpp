#include "alidade/rangefinder/solve/align_edges.h"
#include "alidade/estimation/median.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include "alidade/geometry/decompositions.h"
#include "alidade/pantilt/head_rotation.h"

namespace alidade {
namespace {

using Vector5 = Eigen::Vector<double, 5>;
constexpr double origin_step_m = 0.03, direction_step_rad = 0.02;  // how far the simplex reaches at first
constexpr double usual_m = 0.1, usual_rad = 0.1, prior_weight = 0.1;
constexpr float empty = 1e-3F;  // density of what has no edge, of a uniform one

/// An edge of the scan: where the head looked, and the nearer of the two ranges (that is where the edge is).
struct ScanEdge {
  Eigen::Quaterniond photo_from_cam;
  double range_m = 0.0;
};

double median_step_rad(std::span<const ScanRow> scan) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < scan.size(); ++i)
    steps.push_back(std::hypot(scan[i].pan_rad - scan[i - 1].pan_rad, scan[i].tilt_rad - scan[i - 1].tilt_rad));
  return median_of(std::move(steps));
}

/// Jumps between neighbours along the scan's lines and across them.
std::vector<ScanEdge> edges_of(std::span<const ScanRow> scan, const EdgesConfig& config) {
  const double step_rad = median_step_rad(scan);
  const Eigen::Quaterniond photo_from_base =
      base_from_cam_rotation({config.photo_pan_rad, config.photo_tilt_rad, 0.0}).conjugate();
  std::vector<ScanEdge> edges;
  const auto add = [&](const ScanRow& a, const ScanRow& b) {
    const bool are_neighbours = std::hypot(a.pan_rad - b.pan_rad, a.tilt_rad - b.tilt_rad) < 1.8 * step_rad;
    if (!are_neighbours || !(std::abs(a.range_m - b.range_m) > config.jump_m)) return;
    const Eigen::Quaterniond base_from_cam =
        base_from_cam_rotation({0.5 * (a.pan_rad + b.pan_rad), 0.5 * (a.tilt_rad + b.tilt_rad), 0.0});
    const Eigen::Quaterniond photo_from_cam = photo_from_base * base_from_cam;
    edges.push_back({photo_from_cam, std::min(a.range_m, b.range_m)});
  };
  for (std::size_t i = 1; i < scan.size(); ++i) add(scan[i - 1], scan[i]);
  const auto along_first = [&](auto first, auto second) {
    std::vector<std::size_t> order(scan.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      const double x = std::round(first(scan[a]) / step_rad), y = std::round(first(scan[b]) / step_rad);
      return x != y ? x < y : second(scan[a]) < second(scan[b]);
    });
    for (std::size_t i = 1; i < order.size(); ++i) add(scan[order[i - 1]], scan[order[i]]);
  };
  const auto pan = [](const ScanRow& row) { return row.pan_rad; };
  const auto tilt = [](const ScanRow& row) { return row.tilt_rad; };
  const bool runs_along_pan =
      scan.size() > 1 && std::abs(scan[1].pan_rad - scan[0].pan_rad) > std::abs(scan[1].tilt_rad - scan[0].tilt_rad);
  if (step_rad > 0.0 && runs_along_pan) along_first(pan, tilt);
  if (step_rad > 0.0 && !runs_along_pan) along_first(tilt, pan);
  return edges;
}

/// Recursive low-pass forwards and backwards, four times: nearly a Gaussian, at any width in the same time.
void blur_line(float* value, int count, int stride, double sigma_px) {
  const double q = sigma_px * sigma_px;  // = 8a/(1 − a)²: four times there and back, a/(1 − a)² each way
  const double a = (q + 4.0 - std::sqrt(8.0 * q + 16.0)) / q;
  for (int pass = 0; pass < 4; ++pass) {
    for (int i = 1; i < count; ++i)
      value[i * stride] = static_cast<float>((1.0 - a) * value[i * stride] + a * value[(i - 1) * stride]);
    for (int i = count - 2; i >= 0; --i)
      value[i * stride] = static_cast<float>((1.0 - a) * value[i * stride] + a * value[(i + 1) * stride]);
  }
}

/// Size of the gradient, blurred, over its mean.
GreyImage edge_density(const GreyImage& photo, double blur_px) {
  GreyImage density{photo.width_px, photo.height_px, std::vector<float>(photo.values.size(), 0.0F)};
  const auto at = [&](int x, int y) { return photo.values[static_cast<std::size_t>(y * photo.width_px + x)]; };
  for (int y = 1; y + 1 < photo.height_px; ++y)
    for (int x = 1; x + 1 < photo.width_px; ++x)
      density.values[static_cast<std::size_t>(y * photo.width_px + x)] =
          std::hypot(at(x + 1, y) - at(x - 1, y), at(x, y + 1) - at(x, y - 1));
  for (int y = 0; y < photo.height_px; ++y)
    blur_line(&density.values[static_cast<std::size_t>(y * photo.width_px)], photo.width_px, 1, blur_px);
  for (int x = 0; x < photo.width_px; ++x)
    blur_line(&density.values[static_cast<std::size_t>(x)], photo.height_px, photo.width_px, blur_px);
  const double mean =
      std::accumulate(density.values.begin(), density.values.end(), 0.0) / static_cast<double>(density.values.size());
  for (float& value : density.values) value = mean > 0.0 ? static_cast<float>(value / mean) : 0.0F;
  return density;
}

double log_density(const GreyImage& density, const Eigen::Vector2d& px) {
  const double x = px.x(), y = px.y();
  if (!(x >= 0.0 && y >= 0.0 && x < density.width_px - 1.0 && y < density.height_px - 1.0)) return std::log(empty);
  const auto x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const auto fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
  const float* row = &density.values[static_cast<std::size_t>(y0 * density.width_px + x0)];
  const float* next = row + density.width_px;
  return std::log((1 - fy) * ((1 - fx) * row[0] + fx * row[1]) + fy * ((1 - fx) * next[0] + fx * next[1]) + empty);
}

Beam moved(const Beam& start, const Vector5& step) {
  BeamVector all = BeamVector::Zero();
  all.head<5>() = step;
  return start.retract(all);
}

double mean_log(const std::vector<ScanEdge>& edges, const GreyImage& density, const Camera& camera, const Beam& beam) {
  double sum = 0.0;
  for (const ScanEdge& edge : edges) {
    const auto px = project(camera, edge.photo_from_cam * point_at(beam, edge.range_m));
    sum += px ? log_density(density, *px) : std::log(empty);
  }
  return sum / static_cast<double>(edges.size());
}

/// Least cost by a simplex that starts at 0 with the given edges.
Vector5 simplex(const std::function<double(const Vector5&)>& cost, const Vector5& size, int max_evaluations) {
  std::array<std::pair<double, Vector5>, 6> corners;
  for (int i = 0; i < 6; ++i) {
    Vector5 x = Vector5::Zero();
    if (i > 0) x[i - 1] = size[i - 1];
    corners[static_cast<std::size_t>(i)] = {cost(x), x};
  }
  const auto by_cost = [](const auto& a, const auto& b) { return a.first < b.first; };
  for (int used = 6; used < max_evaluations;) {
    std::sort(corners.begin(), corners.end(), by_cost);
    Vector5 middle = Vector5::Zero();
    for (std::size_t i = 0; i < 5; ++i) middle += 0.2 * corners[i].second;
    const auto along = [&](double t) {
      const Vector5 x = middle + t * (corners[5].second - middle);
      ++used;
      return std::pair{cost(x), x};
    };
    auto trial = along(-1.0);
    if (trial.first < corners[0].first) {
      const auto farther = along(-2.0);
      corners[5] = farther.first < trial.first ? farther : trial;
    } else if (trial.first < corners[4].first) {
      corners[5] = trial;
    } else if (trial = along(trial.first < corners[5].first ? -0.5 : 0.5); trial.first < corners[5].first) {
      corners[5] = trial;
    } else {
      for (std::size_t i = 1; i < 6; ++i, ++used) {
        corners[i].second = 0.5 * (corners[i].second + corners[0].second);
        corners[i].first = cost(corners[i].second);
      }
    }
  }
  return std::min_element(corners.begin(), corners.end(), by_cost)->second;
}

Beam aligned(const std::vector<ScanEdge>& edges, const std::vector<GreyImage>& densities, const Camera& camera,
             const Beam& start, const EdgesConfig& config) {
  Beam beam = start;
  Vector5 size;
  size << Eigen::Vector3d::Constant(origin_step_m), Eigen::Vector2d::Constant(direction_step_rad);
  for (const GreyImage& density : densities) {
    const Beam from = beam;
    // The edges hardly determine the origin: it stays within some centimetres of the start unless they gain much.
    const auto cost = [&](const Vector5& step) {
      const Beam trial = moved(from, step);
      const Eigen::Vector3d away_m = trial.origin_in_cam - start.origin_in_cam;
      const Eigen::Vector3d turned_rad = trial.direction_in_cam - start.direction_in_cam;
      return 0.5 * (away_m.squaredNorm() / (usual_m * usual_m) + turned_rad.squaredNorm() / (usual_rad * usual_rad)) *
                 prior_weight -
             mean_log(edges, density, camera, trial);
    };
    beam = moved(from, simplex(cost, size, config.max_evaluations));
    size *= 0.5;
  }
  return beam;
}

using Matrix5 = Eigen::Matrix<double, 5, 5>;

/// Information of the prior that holds beam and origin near the start, in units of the cost of `aligned`.
Matrix5 prior_information() {
  Vector5 diagonal;
  diagonal << Eigen::Vector3d::Constant(prior_weight / (usual_m * usual_m)),
      Eigen::Vector2d::Constant(prior_weight / (usual_rad * usual_rad));
  return diagonal.asDiagonal();
}

/// Derivatives of a part's share of the mean log density, by differences as wide as its blur asks for.
struct EdgePart {
  Vector5 gradient = Vector5::Zero();
  Matrix5 information = Matrix5::Zero();
};

EdgePart part_of(const std::vector<ScanEdge>& edges, double num_all, const GreyImage& density, const Camera& camera,
                 const Beam& beam) {
  Vector5 width;
  width << Eigen::Vector3d::Constant(0.01), Eigen::Vector2d::Constant(0.003);
  const auto value = [&](const Vector5& step) {
    return static_cast<double>(edges.size()) / num_all * mean_log(edges, density, camera, moved(beam, step));
  };
  const auto along = [&](int i, double sign) -> Vector5 { return sign * width[i] * Vector5::Unit(i); };
  EdgePart part;
  for (int i = 0; i < 5; ++i) {
    part.gradient[i] = (value(along(i, 1.0)) - value(along(i, -1.0))) / (2.0 * width[i]);
    for (int j = 0; j <= i; ++j) {
      const double mixed = value(along(i, 1.0) + along(j, 1.0)) - value(along(i, 1.0) + along(j, -1.0)) -
                           value(along(i, -1.0) + along(j, 1.0)) + value(along(i, -1.0) + along(j, -1.0));
      part.information(i, j) = part.information(j, i) = -mixed / (4.0 * width[i] * width[j]);
    }
  }
  return part;
}

/// Sandwich covariance over parts of the scene, each a slice of the view: edges of one thing err alike. The beam may be
/// `usual_m` and `usual_rad` from where the prior holds it, which moves the optimum by H⁻¹ P of that. And `min_rad`:
/// strong edges draw all nearer ones than the last blur, those that the scan does not see among them.
Matrix5 covariance_of(std::vector<ScanEdge> edges, const GreyImage& density, const Camera& camera, const Beam& beam,
                      double min_rad) {
  constexpr std::size_t num_parts = 8;
  std::stable_sort(edges.begin(), edges.end(), [](const ScanEdge& a, const ScanEdge& b) {
    return (a.photo_from_cam * Eigen::Vector3d::UnitZ()).x() < (b.photo_from_cam * Eigen::Vector3d::UnitZ()).x();
  });
  const auto num = static_cast<double>(edges.size());
  std::vector<EdgePart> parts;
  EdgePart all;
  for (std::size_t k = 0; k < num_parts; ++k) {
    const auto at = [&](std::size_t i) {
      return edges.begin() + static_cast<std::ptrdiff_t>(i * edges.size() / num_parts);
    };
    parts.push_back(part_of({at(k), at(k + 1)}, num, density, camera, beam));
    all.gradient += parts.back().gradient;
    all.information += parts.back().information;
  }
  const SymmetricEigen eigen = symmetric_eigen(all.information);
  const Matrix5 prior = prior_information();
  const Matrix5 H = eigen.vectors * eigen.values.cwiseMax(0.0).asDiagonal() * eigen.vectors.transpose() + prior;
  Matrix5 scatter = Matrix5::Zero();
  for (const EdgePart& part : parts) {
    const Vector5 away = part.gradient - all.gradient / num_parts;
    scatter += num_parts / (num_parts - 1.0) * away * away.transpose();
  }
  const Matrix5 inverse = inverse_symmetric(H);
  Matrix5 cov = inverse * (scatter + prior_weight * prior) * inverse;
  cov.diagonal().tail<2>().array() += min_rad * min_rad;
  return cov;
}

}  // namespace

std::vector<std::string> faults(const EdgesConfig& config) {
  std::vector<std::string> found;
  const auto is_positive = [](double value) { return value > 0.0 && std::isfinite(value); };
  if (!is_positive(config.jump_m)) found.emplace_back("jump_m is not above 0");
  if (config.blur_px.empty() || !std::ranges::all_of(config.blur_px, is_positive)) {
    found.emplace_back("blur_px must have values, each above 0");
  }
  if (!std::isfinite(config.photo_pan_rad) || !std::isfinite(config.photo_tilt_rad)) {
    found.emplace_back("photo_pan_rad and photo_tilt_rad must be finite");
  }
  if (config.max_evaluations < 1) found.emplace_back("max_evaluations must be 1 or more");
  const Beam& guess = config.initial_guess;
  if (!guess.origin_in_cam.allFinite() || !(std::abs(guess.direction_in_cam.norm() - 1.0) < 1e-3)) {
    found.emplace_back("initial_guess is no beam");
  }
  return found;
}

EdgesReport align_edges(std::span<const ScanRow> scan, const GreyImage& photo, const Camera& camera, const Beam& start,
                        const EdgesConfig& config, const Progress& progress) {
  EdgesReport report;
  report.beam = start;
  const std::vector<ScanEdge> edges = edges_of(scan, config);
  report.num_edges = static_cast<int>(edges.size());
  const auto num_pixels =
      static_cast<std::size_t>(std::max(0, photo.width_px)) * static_cast<std::size_t>(std::max(0, photo.height_px));
  if (edges.size() < 20 || photo.width_px < 3 || photo.height_px < 3 || photo.values.size() != num_pixels)
    return report;
  std::vector<GreyImage> densities;
  for (const double blur_px : config.blur_px) densities.push_back(edge_density(photo, blur_px));
  report_progress(progress, "edges", 0, 3);
  report.beam = aligned(edges, densities, camera, start, config);
  report.gain = mean_log(edges, densities.back(), camera, report.beam);
  report.beam.cov.topLeftCorner<5, 5>() =
      covariance_of(edges, densities.back(), camera, report.beam,
                    std::hypot(config.blur_px.back() / params(camera.lens)[0], median_step_rad(scan)));
  std::array<std::vector<ScanEdge>, 2> halves;
  for (std::size_t i = 0; i < edges.size(); ++i) halves[i % 2].push_back(edges[i]);
  std::array<Eigen::Vector3d, 2> directions;
  for (std::size_t i = 0; i < 2; ++i) {
    report_progress(progress, "edges", i + 1, 3);
    directions[i] = aligned(halves[i], densities, camera, start, config).direction_in_cam;
  }
  report.halves_differ_rad = (directions[0] - directions[1]).norm();
  return report;
}

Verdict edges_verdict(const EdgesReport& report) {
  Verdict verdict;
  constexpr int min_edges = 100;
  constexpr double min_gain = 0.3, max_rad = 0.02;
  const auto refuse = [&](const char* sentence, const char* add) {
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::undetermined;
    verdict.sentence = sentence;
    verdict.to_add = add;
  };
  if (report.num_edges < min_edges) {
    refuse("too few edges in the scan", "scan finer, and a scene with things at different distances");
  } else if (!(report.gain > min_gain)) {
    refuse("the edges of the scan are not those of the photo",
           "check the head's angles and the camera file, or take a scene whose walls have no print or texture");
  } else if (!(report.halves_differ_rad < max_rad)) {
    refuse("the two halves of the scan's edges give different directions", "scan finer");
  } else {
    verdict.state = State::care;
    const BeamMatrix& cov = report.beam.cov;
    verdict.sentence =
        "a check of the direction, ± " +
        text_of(3e3 * std::sqrt(cov.block<2, 2>(beam_direction_param, beam_direction_param).trace()), 2) +
        " mrad (3σ), from " + std::to_string(report.num_edges) + " edges; the origin is hardly determined, ± " +
        text_of(3e3 * std::sqrt(cov.topLeftCorner<3, 3>().trace()), 2) + " mm";
    verdict.to_add = "calibrate with a board: --method joint";
  }
  return verdict;
}

}  // namespace alidade
