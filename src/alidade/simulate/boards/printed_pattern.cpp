#include "alidade/simulate/boards/printed_pattern.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <opencv2/aruco.hpp>

#include "alidade/board/dictionary.h"

namespace alidade {
namespace {

/// Bits of every marker of a dictionary with its border, one byte a bit, 0 black.
class MarkerBits {
 public:
  MarkerBits(const std::string& dictionary, int border_bits)
      : dictionary_(cv::aruco::getPredefinedDictionary(marker_dictionary(dictionary)->opencv_id)),
        border_bits_(border_bits) {}

  [[nodiscard]] int side_bits() const { return dictionary_->markerSize + 2 * border_bits_; }
  [[nodiscard]] cv::Mat operator()(int id) const {
    assert(id < dictionary_->bytesList.rows);
    cv::Mat bits;
    cv::aruco::drawMarker(dictionary_, id, side_bits(), bits, border_bits_);
    return bits;
  }

 private:
  cv::Ptr<cv::aruco::Dictionary> dictionary_;
  int border_bits_;
};

bool is_black(const cv::Mat& bits, double x, double y) {  // x, y in [0, 1) of the marker's side
  return bits.at<unsigned char>(static_cast<int>(y * bits.rows), static_cast<int>(x * bits.cols)) == 0;
}

}  // namespace

void PrintedPattern::Axis::finish() {
  std::sort(edges.begin(), edges.end());
  const double tiny = 1e-9 * (edges.back() - edges.front());
  edges.erase(std::unique(edges.begin(), edges.end(), [tiny](double a, double b) { return b - a < tiny; }),
              edges.end());
  const std::size_t num_bins = 4 * edges.size();
  bins_per_m = static_cast<double>(num_bins) / (edges.back() - edges.front());
  first_edge.resize(num_bins + 1);
  for (std::size_t bin = 0; bin <= num_bins; ++bin) {
    const double start = edges.front() + static_cast<double>(bin) / bins_per_m - tiny;
    first_edge[bin] = static_cast<std::size_t>(std::upper_bound(edges.begin(), edges.end(), start) - edges.begin());
  }
}

std::size_t PrintedPattern::Axis::cell(double at) const {
  if (!(at >= edges.front())) return 0;
  if (at >= edges.back()) return edges.size();
  std::size_t i = first_edge[static_cast<std::size_t>((at - edges.front()) * bins_per_m)];
  while (edges[i] <= at) ++i;
  return i;
}

PrintedPattern::Mix PrintedPattern::mix(const Axis& axis, double at, double ramp) {
  constexpr double far_away = std::numeric_limits<double>::infinity();
  const std::size_t cell = axis.cell(at);
  const double left = cell > 0 ? at - axis.edges[cell - 1] : far_away;
  const double right = cell < axis.edges.size() ? axis.edges[cell] - at : far_away;
  const double distance = std::min(left, right);
  return {cell, left < right ? cell - 1 : cell + 1, std::max(0.0, 0.5 - distance / ramp), distance};
}

double PrintedPattern::cell_ink(std::size_t col, std::size_t row, double outside) const {
  const signed char ink = ink_[row * x_.num_cells() + col];
  return ink < 0 ? outside : static_cast<double>(ink);
}

double PrintedPattern::ink(const Eigen::Vector2d& place, const Eigen::Vector2d& ramp, double outside) const {
  const Mix x = mix(x_, place.x(), ramp.x()), y = mix(y_, place.y(), ramp.y());
  double ink = cell_ink(x.near, y.near, outside);
  if (x.far_weight > 0.0 || y.far_weight > 0.0) {
    const auto row_ink = [&](std::size_t row) {
      const double near = cell_ink(x.near, row, outside);
      return x.far_weight > 0.0 ? near + x.far_weight * (cell_ink(x.far, row, outside) - near) : near;
    };
    ink = row_ink(y.near);
    if (y.far_weight > 0.0) ink += y.far_weight * (row_ink(y.far) - ink);
  }
  if (disc_radius_m_ > 0.0) {
    const double depth = disc_radius_m_ - nearest_disc_distance(place);
    ink += (1.0 - ink) * std::clamp(0.5 + depth / std::max(ramp.x(), ramp.y()), 0.0, 1.0);
  }
  return ink;
}

std::optional<double> PrintedPattern::even_ink(const Eigen::Vector2d& place, const Eigen::Vector2d& reach,
                                               double outside) const {
  const Mix x = mix(x_, place.x(), 1.0), y = mix(y_, place.y(), 1.0);
  if (x.distance < reach.x() || y.distance < reach.y()) return std::nullopt;
  const double ink = cell_ink(x.near, y.near, outside);
  if (!(disc_radius_m_ > 0.0)) return ink;
  const double depth = disc_radius_m_ - nearest_disc_distance(place);
  if (std::abs(depth) < reach.norm()) return std::nullopt;
  return depth > 0.0 ? 1.0 : ink;
}

/// Distance to the nearest disc's centre.
double PrintedPattern::nearest_disc_distance(const Eigen::Vector2d& place) const {
  const bool staggered = board_.kind == BoardKind::asymmetric_circles;
  const Eigen::Vector2d at = place / board_.square_m;
  const int centre_row = static_cast<int>(std::lround(std::clamp(at.y(), -2.0, board_.rows + 1.0)));
  double least = std::numeric_limits<double>::infinity();
  for (int row = std::max(0, centre_row - 1); row <= std::min(board_.rows - 1, centre_row + 1); ++row) {
    const double shift = staggered ? row % 2 : 0, pitch = staggered ? 2.0 : 1.0;
    const double col = std::clamp(std::round((at.x() - shift) / pitch), 0.0, board_.cols - 1.0);
    least = std::min(least, std::hypot(at.x() - (col * pitch + shift), at.y() - row));
  }
  return least * board_.square_m;
}

PrintedPattern::PrintedPattern(const Board& board) : board_(board) {
  switch (board.kind) {
    case BoardKind::chessboard:
    case BoardKind::charuco:
      print_chessboard(board);
      break;
    case BoardKind::aprilgrid:
      print_tags(board);
      break;
    case BoardKind::circles:
    case BoardKind::asymmetric_circles:
      print_discs(board);
      break;
  }
}

/// One cell more all around for the margin; all cells are paper, those beyond the margin are not.
void PrintedPattern::fill_margin(double margin_m) {
  for (Axis* axis : {&x_, &y_}) {
    const auto [least, most] = std::minmax_element(axis->edges.begin(), axis->edges.end());
    const double before = *least - margin_m, after = *most + margin_m;
    (axis == &x_ ? print_min_.x() : print_min_.y()) = *least;
    (axis == &x_ ? print_max_.x() : print_max_.y()) = *most;
    axis->edges.push_back(before);
    axis->edges.push_back(after);
    axis->finish();
  }
  ink_.assign(x_.num_cells() * y_.num_cells(), 0);
  for (std::size_t row = 0; row < y_.num_cells(); ++row) {
    for (std::size_t col = 0; col < x_.num_cells(); ++col) {
      const bool off_paper = row == 0 || col == 0 || row == y_.num_cells() - 1 || col == x_.num_cells() - 1;
      if (off_paper) ink_[row * x_.num_cells() + col] = -1;
    }
  }
}

/// Squares with a black one at the top left; on a charuco board the white ones hold markers, numbered row by row.
void PrintedPattern::print_chessboard(const Board& board) {
  const bool has_markers = board.kind == BoardKind::charuco;
  const double side = board.square_m, border = 0.5 * (side - board.marker_m);
  std::vector<cv::Mat> markers;
  int bits = 0;
  if (has_markers) {
    const MarkerBits draw(board.dictionary, 1);
    bits = draw.side_bits();
    for (int i = 0; i < ((board.cols + 1) * (board.rows + 1)) / 2; ++i) markers.push_back(draw(i));
  }
  const auto add_edges = [&](Axis& axis, int num_squares) {
    for (int i = -1; i < num_squares; ++i) axis.edges.push_back(i * side);
    for (int i = -1; has_markers && i < num_squares - 1; ++i)
      for (int bit = 0; bit <= bits; ++bit) axis.edges.push_back(i * side + border + board.marker_m * bit / bits);
  };
  add_edges(x_, board.cols + 1);
  add_edges(y_, board.rows + 1);
  fill_margin(side);
  for (std::size_t row = 2; row + 2 < y_.num_cells(); ++row) {
    for (std::size_t col = 2; col + 2 < x_.num_cells(); ++col) {
      const double x = x_.centre(col) / side + 1.0, y = y_.centre(row) / side + 1.0;
      const int i = static_cast<int>(x), j = static_cast<int>(y);
      bool black = (i + j) % 2 == 0;
      if (has_markers && !black) {
        const int whites_above = (j * (board.cols + 1)) / 2, whites_left = j % 2 == 0 ? i / 2 : (i + 1) / 2;
        const double mx = ((x - i) * side - border) / board.marker_m, my = ((y - j) * side - border) / board.marker_m;
        black = mx > 0 && mx < 1 && my > 0 && my < 1 &&
                is_black(markers[static_cast<std::size_t>(whites_above + whites_left)], mx, my);
      }
      ink_[row * x_.num_cells() + col] = black;
    }
  }
}

/// Kalibr's target: tags with a border of two bits, numbered from the bottom left upwards, black squares in the gaps.
void PrintedPattern::print_tags(const Board& board) {
  const double side = board.square_m, gap = board.marker_m, pitch = side + gap;
  const MarkerBits draw("DICT_APRILTAG_36h11", 2);
  std::vector<cv::Mat> tags;
  for (int i = 0; i < board.cols * board.rows; ++i) tags.push_back(draw(i));
  const auto add_edges = [&](Axis& axis, int num_tags) {
    axis.edges.push_back(-gap);
    for (int i = 0; i < num_tags; ++i) {
      for (int bit = 0; bit <= draw.side_bits(); ++bit) axis.edges.push_back(i * pitch + side * bit / draw.side_bits());
      axis.edges.push_back((i + 1) * pitch);
    }
  };
  add_edges(x_, board.cols);
  add_edges(y_, board.rows);
  fill_margin(0.5 * side);
  for (std::size_t row = 2; row + 2 < y_.num_cells(); ++row) {
    for (std::size_t col = 2; col + 2 < x_.num_cells(); ++col) {
      const double x = x_.centre(col) + pitch, y = y_.centre(row) + pitch;  // of the cell's pitch: tag, then gap
      const int i = static_cast<int>(x / pitch) - 1, j = static_cast<int>(y / pitch) - 1;
      const double tx = (x / pitch - (i + 1)) * pitch / side, ty = (y / pitch - (j + 1)) * pitch / side;
      const bool in_gap_x = tx > 1.0, in_gap_y = ty > 1.0;
      const auto tag = static_cast<std::size_t>((board.rows - 1 - j) * board.cols + i);
      ink_[row * x_.num_cells() + col] = in_gap_x == in_gap_y && (in_gap_x || is_black(tags[tag], tx, ty));
    }
  }
}

void PrintedPattern::print_discs(const Board& board) {
  disc_radius_m_ = circle_radius_m(board);
  const Eigen::Vector3d last = points_in_board(board).back();
  const double last_x = board.kind == BoardKind::circles ? last.x() : (2 * board.cols - 1) * board.square_m;
  x_.edges = {-disc_radius_m_, last_x + disc_radius_m_};
  y_.edges = {-disc_radius_m_, last.y() + disc_radius_m_};
  fill_margin(board.square_m - disc_radius_m_);
}

}  // namespace alidade
