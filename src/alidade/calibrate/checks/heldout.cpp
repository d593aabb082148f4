#include "alidade/calibrate/checks/heldout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "alidade/calibrate/solve/bundle.h"
#include "alidade/calibrate/solve/start.h"

namespace alidade {
namespace {

struct Candidate {
  std::string name;
  std::string model;
  std::vector<std::string> fixed;
};

/// From plain to rich; a richer one frees terms of the one before.
const std::vector<Candidate>& ladder() {
  static const std::vector<Candidate> steps = {
      {"k1", "brown", {"skew", "k2", "p1", "p2", "k3"}},
      {"k1 k2", "brown", {"skew", "p1", "p2", "k3"}},
      {"k1 k2 p1 p2", "brown", {"skew", "k3"}},
      {"k1 k2 p1 p2 k3", "brown", {"skew"}},
      {"k1 k2 p1 p2 k3 skew", "brown", {}},
      {"kannala_brandt", "kannala_brandt", {"skew"}},
  };
  return steps;
}

bool same_set(std::vector<std::string> a, std::vector<std::string> b) {
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  return a == b;
}

/// The ladder with the model in use marked, or with it put first where it is on no step.
std::vector<Candidate> candidates(const CalibrateConfig& config, std::size_t& in_use) {
  std::vector<Candidate> all = ladder();
  for (in_use = 0; in_use < all.size(); ++in_use) {
    if (all[in_use].model == config.model && same_set(all[in_use].fixed, config.fixed)) return all;
  }
  all.insert(all.begin(), {config.model + " (as asked)", config.model, config.fixed});
  in_use = 0;
  return all;
}

/// Whether what is known of a parameter holds in that model, too: else a model would be preferred for its prior.
bool stands_in(const Candidate& other, const CalibrateConfig& config, const Prior& prior) {
  constexpr std::array<std::string_view, 4> central{"fx", "fy", "cx", "cy"};
  if (std::ranges::find(central, prior.name) != central.end()) return true;
  return other.model == config.model && std::ranges::find(other.fixed, prior.name) == other.fixed.end();
}

bool is_richer(const Candidate& a, const Candidate& than) {
  if (a.model != than.model) return than.model == "pinhole" || than.model == "flat_port" || a.model == "kannala_brandt";
  return a.fixed.size() < than.fixed.size();
}

/// Mean squared residual [px²] of a view whose pose is estimated with lens and board fixed. NaN where it has none.
double heldout_error(const Lens& lens, const std::vector<Eigen::Vector3d>& board_points, const BoardView& view) {
  Camera camera;
  camera.lens = lens;
  const auto start = pose_from_plane(camera, view, board_points);
  const ViewArrays arrays = make_arrays(view);
  const auto pose = start ? refine_pose(lens, board_points, arrays, *start) : std::nullopt;
  if (!pose) return std::nan("");
  std::vector<double> squares;
  for (const auto& r : residuals_px({lens, {*pose}, board_points}, 0, arrays)) squares.push_back(r.squaredNorm());
  // The best nineteen in twenty corners: one wrong corner is not the lens' fault.
  std::sort(squares.begin(), squares.end());
  squares.resize(std::max<std::size_t>(1, squares.size() * 19 / 20));
  double sum = 0.0;
  for (const double square : squares) sum += square;
  return sum / static_cast<double>(squares.size());
}

/// Held-out error of every view under one model.
std::vector<double> heldout_errors(const Board& board, std::span<const BoardView> views, ImageSize size,
                                   CalibrateConfig config, const std::vector<Eigen::Vector3d>& board_points) {
  std::vector<double> errors(views.size(), std::nan(""));
  const std::size_t folds = std::min<std::size_t>(5, views.size() / 2);
  config.board_shape = BoardShape::given;  // as estimated from all photos: the lens is compared
  for (std::size_t fold = 0; fold < folds; ++fold) {
    std::vector<BoardView> kept;
    for (std::size_t k = 0; k < views.size(); ++k) {
      if (k % folds != fold) kept.push_back(views[k]);
    }
    const CalibrateReport report = calibrate(board, kept, size, config, board_points);
    if (report.status != CalibrateReport::Status::converged) continue;
    for (std::size_t k = fold; k < views.size(); k += folds) {
      errors[k] = heldout_error(report.camera.lens, board_points, views[k]);
    }
  }
  return errors;
}

double mean(const std::vector<double>& values) {
  double sum = 0.0, count = 0.0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    sum += value;
    count += 1.0;
  }
  return count > 0.0 ? sum / count : std::nan("");
}

/// Gain of `other` over `used` in RMS, and its σ from the scatter of the photos' paired differences.
void compare(const std::vector<double>& used, const std::vector<double>& other, HeldOutModel& row) {
  const double rms = std::sqrt(mean(used));
  std::vector<double> differences, squares;
  for (std::size_t k = 0; k < used.size(); ++k) differences.push_back((used[k] - other[k]) / (2.0 * rms));
  row.gain_px = mean(differences);
  for (const double d : differences) squares.push_back((d - row.gain_px) * (d - row.gain_px));
  const auto count = static_cast<double>(
      std::count_if(differences.begin(), differences.end(), [](double d) { return std::isfinite(d); }));
  row.sigma_px = std::sqrt(mean(squares) / std::max(1.0, count - 1.0));
}

}  // namespace

std::vector<HeldOutModel> heldout_models(const Board& board, std::span<const BoardView> views, ImageSize size,
                                         const CalibrateConfig& config,
                                         const std::vector<Eigen::Vector3d>& board_points, const Progress& progress) {
  std::size_t in_use = 0;
  const std::vector<Candidate> all = candidates(config, in_use);
  std::vector<std::vector<double>> errors;
  for (std::size_t i = 0; i < all.size(); ++i) {
    report_progress(progress, "comparing lens models", i, all.size());
    CalibrateConfig other = config;
    other.model = all[i].model;
    other.fixed = all[i].fixed;
    if (i != in_use) std::erase_if(other.priors, [&](const Prior& prior) { return !stands_in(all[i], config, prior); });
    errors.push_back(heldout_errors(board, views, size, other, board_points));
  }
  std::vector<HeldOutModel> rows;
  for (std::size_t i = 0; i < all.size(); ++i) {
    HeldOutModel row;
    row.name = all[i].name;
    row.heldout_rms_px = std::sqrt(mean(errors[i]));
    row.is_richer = i != in_use && is_richer(all[i], all[in_use]);
    if (i != in_use) compare(errors[in_use], errors[i], row);
    rows.push_back(row);
  }
  return rows;
}

}  // namespace alidade
