#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The word of --board-shape for a shape.
[[nodiscard]] std::string shape_name(BoardShape shape);

/// A board shape estimated on one half of the photos and fixed on the other, both ways.
struct ShapeTransfer {
  BoardShape shape = BoardShape::free;  ///< bow or free.
  double flat_rms_px = 0.0;             ///< Of both halves with the board flat, or as it was given.
  double transfer_rms_px = 0.0;         ///< With the other half's shape.
  double gain_sigmas = 0.0;             ///< Mean gain of a photo, in the σ of that mean from photo to photo.

  /// Whether a requested shape is used. A bow is two parameters and costs little: it is used where the photos
  /// agree that it helps, by however little. Every point free costs σ and takes up faults of the lens: it must help by
  /// 5 %.
  [[nodiscard]] bool transfers() const;
  /// Whether it is used by default: every point free must help by a clear tenth.
  [[nodiscard]] bool is_proved() const;
};

/// Views of even (0) or odd (1) index.
[[nodiscard]] std::vector<BoardView> every_other(std::span<const BoardView> views, std::size_t parity);

/// Tests a bow and, unless a bow was requested, every point free, against a flat board or, with
/// BoardShape::given, `given_points` [m]. Empty for fewer than six photos; a shape that a half does not determine is
/// omitted.
[[nodiscard]] std::vector<ShapeTransfer> test_shape_transfer(const Board& board, std::span<const BoardView> views,
                                                             ImageSize size, const CalibrateConfig& config,
                                                             std::span<const Eigen::Vector3d> given_points = {});

/// The shape to use: of those proved the one that predicts best, else flat; a requested one if it transfers,
/// else the bow if that does, else flat.
[[nodiscard]] BoardShape decide_shape(BoardShape asked, std::span<const ShapeTransfer> transfers);

/// The test to show: of the shape in use; else of those proved, or of all, the one that predicts best.
[[nodiscard]] std::optional<ShapeTransfer> max_informative(std::span<const ShapeTransfer> transfers, BoardShape in_use);

ALIDADE_PUBLIC_END
}  // namespace alidade
