#include "alidade/calibrate/shape_transfer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace alidade {
namespace {

constexpr std::size_t min_photos_to_halve = 6;  // two halves of three

bool converged(const CalibrateReport& report) { return report.status == CalibrateReport::Status::converged; }

/// What the photos say of one shape, summed over both halves.
struct Gains {
  double flat = 0.0, transferred = 0.0, corners = 0.0;  ///< Sums of squares [px²].
  std::vector<double> of_photo;                         ///< [px²]

  void add(const CalibrateReport& without, const CalibrateReport& pupil) {
    flat += without.rms_px * without.rms_px * without.corners_used;
    transferred += pupil.rms_px * pupil.rms_px * pupil.corners_used;
    corners += pupil.corners_used;
    for (std::size_t k = 0; k < pupil.views.size(); ++k) {
      if (!pupil.views[k].used || !without.views[k].used) continue;
      const double a = without.views[k].rms_px, b = pupil.views[k].rms_px;
      of_photo.push_back((a * a - b * b) * static_cast<double>(pupil.views[k].corners.size()));
    }
  }

  [[nodiscard]] double sigmas() const {
    const auto count = static_cast<double>(of_photo.size());
    if (count < 2.0) return 0.0;
    double sum = 0.0, squares = 0.0;
    for (const double gain : of_photo) sum += gain;
    for (const double gain : of_photo) squares += (gain - sum / count) * (gain - sum / count);
    return sum / std::sqrt(count * std::max(squares / (count - 1.0), 1e-300));
  }
};

/// The photos' halves with the board as it is without a shape.
struct Half {
  std::vector<BoardView> views;
  CalibrateReport without;
};

std::optional<ShapeTransfer> test_shape(BoardShape shape, const Board& board, const std::array<Half, 2>& halves,
                                        ImageSize size, const CalibrateConfig& config) {
  CalibrateConfig shaped = config, held = config;
  shaped.board_shape = shape;
  held.board_shape = BoardShape::given;
  Gains gains;
  for (const std::size_t parity : {0u, 1u}) {
    const auto teacher = calibrate(board, halves[parity].views, size, shaped);
    if (!converged(teacher)) return std::nullopt;
    const Half& other = halves[1 - parity];
    const auto pupil = calibrate(board, other.views, size, held, teacher.board_points);
    if (!converged(pupil)) return std::nullopt;
    gains.add(other.without, pupil);
  }
  return ShapeTransfer{shape, std::sqrt(gains.flat / gains.corners), std::sqrt(gains.transferred / gains.corners),
                       gains.sigmas()};
}

const ShapeTransfer* best_of(std::span<const ShapeTransfer> transfers, bool (ShapeTransfer::*is_fit)() const) {
  const ShapeTransfer* best = nullptr;
  for (const ShapeTransfer& each : transfers) {
    if (is_fit != nullptr && !(each.*is_fit)()) continue;
    if (best == nullptr || each.transfer_rms_px < best->transfer_rms_px) best = &each;
  }
  return best;
}

}  // namespace

std::string shape_name(BoardShape shape) {
  switch (shape) {
    case BoardShape::flat:
      return "flat";
    case BoardShape::bow:
      return "bow";
    case BoardShape::free:
      return "free";
    case BoardShape::given:
      return "given";
    case BoardShape::automatic:
      return "auto";
  }
  return "flat";
}

bool ShapeTransfer::transfers() const {
  constexpr double agreed_sigmas = 2.0;
  const bool agreed = shape == BoardShape::bow && gain_sigmas > agreed_sigmas && transfer_rms_px < flat_rms_px;
  return agreed || transfer_rms_px < 0.95 * flat_rms_px;
}

bool ShapeTransfer::is_proved() const {
  return transfers() && (shape == BoardShape::bow || transfer_rms_px < 0.9 * flat_rms_px);
}

std::vector<BoardView> every_other(std::span<const BoardView> views, std::size_t parity) {
  std::vector<BoardView> chosen;
  for (std::size_t k = parity; k < views.size(); k += 2) chosen.push_back(views[k]);
  return chosen;
}

std::vector<ShapeTransfer> test_shape_transfer(const Board& board, std::span<const BoardView> views, ImageSize size,
                                               const CalibrateConfig& config,
                                               std::span<const Eigen::Vector3d> given_points) {
  std::vector<ShapeTransfer> transfers;
  if (views.size() < min_photos_to_halve) return transfers;
  CalibrateConfig plain = config;
  if (config.board_shape != BoardShape::given) plain.board_shape = BoardShape::flat;
  std::array<Half, 2> halves;
  for (const std::size_t parity : {0u, 1u}) {
    Half& half = halves[parity];
    half.views = every_other(views, parity);
    half.without = calibrate(board, half.views, size, plain, given_points);
    if (!converged(half.without)) return transfers;
  }
  for (const BoardShape shape : {BoardShape::bow, BoardShape::free}) {
    if (shape == BoardShape::free && config.board_shape == BoardShape::bow) continue;
    if (const auto transfer = test_shape(shape, board, halves, size, config)) transfers.push_back(*transfer);
  }
  return transfers;
}

BoardShape decide_shape(BoardShape asked, std::span<const ShapeTransfer> transfers) {
  if (asked == BoardShape::automatic) {
    const ShapeTransfer* best = best_of(transfers, &ShapeTransfer::is_proved);
    return best != nullptr ? best->shape : BoardShape::flat;
  }
  // Without a test there is nothing that contradicts the requested one.
  if ((asked != BoardShape::bow && asked != BoardShape::free) || transfers.empty()) return asked;
  for (const ShapeTransfer& each : transfers) {
    if (each.shape == asked && each.transfers()) return asked;
  }
  for (const ShapeTransfer& each : transfers) {
    if (each.shape == BoardShape::bow && each.transfers()) return BoardShape::bow;
  }
  return BoardShape::flat;
}

std::optional<ShapeTransfer> max_informative(std::span<const ShapeTransfer> transfers, BoardShape in_use) {
  for (const ShapeTransfer& each : transfers) {
    if (each.shape == in_use) return each;
  }
  const ShapeTransfer* best = best_of(transfers, &ShapeTransfer::is_proved);
  if (best == nullptr) best = best_of(transfers, nullptr);
  return best != nullptr ? std::optional(*best) : std::nullopt;
}

}  // namespace alidade
