#include "alidade/calibrate/checks/corner_numbering.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "alidade/calibrate/solve/homography.h"
#include "alidade/estimation/median.h"

namespace alidade {
namespace {

using Points = std::vector<Eigen::Vector2d>;
/// Where a corner of that number would lie.
using Numbering = std::function<Eigen::Vector2d(int index)>;

constexpr std::size_t min_corners = 8;  // a homography has as many numbers as four corners

/// How a view's corners lie on the board, as far as a perspective tells.
struct Perspective {
  double misfit = 0.0;  ///< Median distance of the corners from it, in spacings of theirs.
  bool is_behind = false;
};

/// Mean spacing [px]: that of as many points spread evenly over a rectangle of the same second moments.
double spacing_px(const Points& px) {
  const auto count = static_cast<double>(px.size());
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& p : px) mean += p / count;
  Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& p : px) moments += (p - mean) * (p - mean).transpose() / count;
  constexpr double of_rectangle = 12.0;  // area² = 12² · det of the moments
  return std::sqrt(of_rectangle * std::sqrt(std::max(0.0, moments.determinant())) / count);
}

std::optional<Perspective> perspective_of(const BoardView& view, const Numbering& numbering) {
  Points on_board, px;
  for (const Corner& corner : view.corners) {
    on_board.push_back(numbering(corner.index));
    px.push_back(corner.px);
  }
  const double spacing = spacing_px(px);
  const auto H = fit_homography(on_board, px);
  if (!H || !(spacing > 0.0)) return std::nullopt;
  std::vector<double> distances;
  int behind = 0;
  for (std::size_t i = 0; i < px.size(); ++i) {
    const Eigen::Vector3d image = *H * on_board[i].homogeneous();
    distances.push_back((Eigen::Vector2d(image.hnormalized()) - px[i]).norm() / spacing);
    behind += H->determinant() * image.z() < 0.0 ? 1 : -1;  // the sign of the Jacobian there
  }
  const double misfit = median_of(distances);
  if (!std::isfinite(misfit)) return std::nullopt;
  return Perspective{misfit, behind > 0};
}

/// Another numbering that takes the view to a perspective, in words; empty for none.
std::string fitting_numbering(const Board& board, const BoardView& view, const Numbering& numbering, double misfit) {
  constexpr double far_better = 0.2;
  const auto fits = [&](const Numbering& other) {
    const auto found = perspective_of(view, other);
    return found && found->misfit < far_better * misfit;
  };
  if (num_points(board) != board.cols * board.rows) return "";
  const int cols = board.cols, rows = board.rows;
  if (fits([&](int i) { return numbering((i % rows) * cols + i / rows); }))
    return "its corners are numbered column by column, not row by row";
  if (fits([&](int i) { return numbering(i / cols * cols + (i / cols % 2 == 0 ? i % cols : cols - 1 - i % cols)); }))
    return "its corners are numbered from left and from right in turn, not each row from the left";
  constexpr int widest = 60;
  for (int other = 2; other <= std::min(widest, num_points(board) / 2); ++other) {
    if (other != cols && fits([&](int i) { return Eigen::Vector2d(i % other, i / other); }))
      return fmt::format("its corners are numbered as on a board with {} in a row, not {}", other, cols);
  }
  return "";
}

/// Those few that are seen from behind, where most are not.
void name_few_behind(std::span<const std::optional<Perspective>> found, std::vector<std::string>& faults) {
  std::size_t behind = 0, seen = 0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    if (!found[k] || !faults[k].empty()) continue;
    ++seen;
    behind += found[k]->is_behind ? 1 : 0;
  }
  if (2 * behind >= seen) return;
  for (std::size_t k = 0; k < found.size(); ++k) {
    if (found[k] && faults[k].empty() && found[k]->is_behind)
      faults[k] =
          "its board is seen from behind, unlike the others': a mirrored image, u and v exchanged, or corners numbered "
          "the other way";
  }
}

}  // namespace

bool is_nearly_flat(std::span<const Eigen::Vector3d> board_points) {
  constexpr double flat = 0.1;
  double size = 0.0, height = 0.0;
  for (const Eigen::Vector3d& point : board_points) {
    size = std::max(size, point.head<2>().cwiseAbs().maxCoeff());
    height = std::max(height, std::abs(point.z()));
  }
  return height <= flat * size;
}

std::vector<std::string> numbering_faults(const Board& board, std::span<const BoardView> views,
                                          std::span<const Eigen::Vector3d> board_points) {
  const Numbering as_given = [&](int i) -> Eigen::Vector2d {
    return board_points[static_cast<std::size_t>(i)].head<2>();
  };
  std::vector<std::optional<Perspective>> found(views.size());
  std::vector<double> misfits;
  for (std::size_t k = 0; k < views.size(); ++k) {
    if (views[k].corners.size() < min_corners) continue;
    found[k] = perspective_of(views[k], as_given);
    if (found[k]) misfits.push_back(found[k]->misfit);
  }
  std::vector<std::string> faults(views.size());
  if (misfits.empty() || !is_nearly_flat(board_points)) return faults;
  constexpr double doubtful = 0.5, none = 1.0, usual = 0.25;  // spacings; strong distortion makes some 0.3
  const bool others_fit = median_of(misfits) < usual;
  for (std::size_t k = 0; k < views.size(); ++k) {
    if (!found[k] || found[k]->misfit < doubtful) continue;
    faults[k] = fitting_numbering(board, views[k], as_given, found[k]->misfit);
    if (faults[k].empty() && others_fit && found[k]->misfit > none)
      faults[k] = "its corners are in no perspective of the board: they are numbered otherwise, or another board's";
  }
  name_few_behind(found, faults);
  return faults;
}

}  // namespace alidade
