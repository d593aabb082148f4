#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The name of a shape in --board-shape.
[[nodiscard]] std::string shape_name(BoardShape shape);

/// Cross-validation of a board shape: estimated on one half of the photos and fixed on the other, both ways.
struct ShapeTransfer {
  BoardShape shape = BoardShape::free;  ///< bow or free.
  double flat_rms_px = 0.0;             ///< RMS of both halves with the board flat, or as it was given.
  double transfer_rms_px = 0.0;         ///< RMS with the shape estimated on the other half.
  double gain_sigmas = 0.0;  ///< Mean gain of a photo over the σ of that mean, from the scatter between photos.

  /// Whether a requested shape is used. A bow has two parameters and costs little: it is used where the photos agree
  /// that it helps, however little. With every point free, σ grows and errors of the lens are absorbed: that shape must
  /// lower the RMS by 5 %.
  [[nodiscard]] bool transfers() const;
  /// Whether it is used by default: with every point free, it must lower the RMS by 10 %.
  [[nodiscard]] bool is_proved() const;
};

/// Views of even (0) or odd (1) index.
[[nodiscard]] std::vector<BoardView> every_other(std::span<const BoardView> views, std::size_t parity);

/// Tests a bow and, unless a bow was requested, every point free, against a flat board or, with
/// BoardShape::given, `given_points` [m]. Empty for fewer than six photos; a shape that one half does not determine is
/// omitted.
[[nodiscard]] std::vector<ShapeTransfer> test_shape_transfer(const Board& board, std::span<const BoardView> views,
                                                             ImageSize size, const CalibrateConfig& config,
                                                             std::span<const Eigen::Vector3d> given_points = {});

/// The shape to use. By default: of the proved ones, the one that predicts best, else flat. A requested shape, if it
/// transfers; otherwise the bow if that one transfers, else flat.
[[nodiscard]] BoardShape decide_shape(BoardShape asked, std::span<const ShapeTransfer> transfers);

/// The test to show: that of the shape in use; else the one that predicts best, among the proved ones or all.
[[nodiscard]] std::optional<ShapeTransfer> max_informative(std::span<const ShapeTransfer> transfers, BoardShape in_use);

ALIDADE_PUBLIC_END
}  // namespace alidade
