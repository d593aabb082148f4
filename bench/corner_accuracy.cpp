// Corners found on rendered boards with exact truth, ours beside OpenCV's: error per coordinate, corners found wrong,
// milliseconds a photo, and how well our stated σ predicts the scatter. Run by `make study`.
#include <fmt/format.h>

#include <Eigen/LU>
#include <chrono>
#include <cmath>
#include <functional>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/board_detector/find_board.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/example_camera.h"

namespace alidade {
namespace {

struct Condition {
  const char* name;
  double blur_px, noise, max_tilt_rad;
};

struct Method {
  const char* name;
  std::function<BoardView(const cv::Mat& photo, const Board& board)> find;
};

BoardView ours(const cv::Mat& photo, const Board& board) { return find_board(photo, board).view; }

BoardView view_of(const std::vector<cv::Point2f>& corners) {
  BoardView view;
  for (std::size_t i = 0; i < corners.size(); ++i)
    view.corners.push_back({static_cast<int>(i), {corners[i].x, corners[i].y}, Eigen::Matrix2d::Identity()});
  return view;
}

Method opencv_window(const char* name, int half_window) {
  return {name, [half_window](const cv::Mat& photo, const Board& board) {
            std::vector<cv::Point2f> corners;
            if (!cv::findChessboardCorners(photo, {board.cols, board.rows}, corners)) return BoardView{};
            cv::cornerSubPix(photo, corners, {half_window, half_window}, {-1, -1},
                             {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 30, 0.001});
            return view_of(corners);
          }};
}

BoardView opencv_sectors(const cv::Mat& photo, const Board& board) {
  std::vector<cv::Point2f> corners;
  constexpr int flags = cv::CALIB_CB_ACCURACY | cv::CALIB_CB_EXHAUSTIVE;
  if (!cv::findChessboardCornersSB(photo, {board.cols, board.rows}, corners, flags)) return {};
  return view_of(corners);
}

/// OpenCV may number a square board from any of its corners: the truth numbered so that it fits the first one.
std::vector<Eigen::Vector2d> nearest_turn(std::vector<Eigen::Vector2d> truth, const Corner& first) {
  std::vector<Eigen::Vector2d> best = truth;
  const auto side = static_cast<std::size_t>(std::lround(std::sqrt(truth.size())));
  const auto at = static_cast<std::size_t>(first.index);
  for (int turn = 0; turn < 4; ++turn) {
    std::vector<Eigen::Vector2d> next(truth.size());
    for (std::size_t i = 0; i < truth.size(); ++i) next[(i % side) * side + side - 1 - i / side] = truth[i];
    truth = next;
    if ((truth[at] - first.px).norm() < (best[at] - first.px).norm()) best = truth;
  }
  return best;
}

struct Score {
  int num_boards = 0, num_found = 0, num_wrong = 0;
  double sum_squares = 0.0, sum_chi2 = 0.0, worst_px = 0.0, seconds = 0.0;

  /// Corners further than `wrong_px` from the truth count as wrong and are excluded from the RMS.
  void add(const BoardView& view, const std::vector<Eigen::Vector2d>& truth) {
    constexpr double wrong_px = 1.0;
    if (view.corners.empty()) return;
    ++num_boards;
    const std::vector<Eigen::Vector2d> turned = nearest_turn(truth, view.corners.front());
    for (const Corner& corner : view.corners) {
      const Eigen::Vector2d error = corner.px - turned[static_cast<std::size_t>(corner.index)];
      worst_px = std::max(worst_px, error.norm());
      if (!(error.norm() <= wrong_px)) {
        ++num_wrong;
        continue;
      }
      sum_squares += error.squaredNorm();
      sum_chi2 += error.dot(corner.cov.inverse() * error);
      ++num_found;
    }
  }
};

void run(const Condition& condition, const std::vector<Method>& methods, int num_photos) {
  const Board board{BoardKind::chessboard, 10, 10, 0.02, 0.0, ""};
  constexpr double fill_per_px = 11.0 / 600.0;  // eleven squares over the image's height
  const BoardScene scene = draw_board_scene(*example_camera("brown", 800, 600), board,
                                            {.num_photos = num_photos,
                                             .max_tilt_rad = condition.max_tilt_rad,
                                             .min_fill = 28.0 * fill_per_px,
                                             .max_fill = 44.0 * fill_per_px},
                                            1);
  std::vector<Score> scores(methods.size());
  for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
    const cv::Mat photo = render_board_photo(scene, i, {.blur_px = condition.blur_px, .noise = condition.noise}, 1);
    for (std::size_t m = 0; m < methods.size(); ++m) {
      const auto start = std::chrono::steady_clock::now();
      const BoardView view = methods[m].find(photo, board);
      scores[m].seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      scores[m].add(view, true_corners(scene, i));
    }
  }
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const Score& score = scores[m];
    const double rms = std::sqrt(score.sum_squares / (2 * score.num_found));
    const double per_sigma = std::sqrt(score.sum_chi2 / (2 * score.num_found));
    fmt::print("{:28} {:26} {:2}/{:2} boards  rms {:.4f} px  max {:7.3f} px  wrong {:3}  {:6.1f} ms{}\n",
               condition.name, methods[m].name, score.num_boards, num_photos, rms, score.worst_px, score.num_wrong,
               1e3 * score.seconds / num_photos, m == 0 ? fmt::format("  error/σ {:.3f}", per_sigma) : "");
  }
}

}  // namespace
}  // namespace alidade

int main() {
  using alidade::Condition;
  const std::vector<alidade::Method> methods{{"alidade", alidade::ours},
                                             alidade::opencv_window("OpenCV window 5", 5),
                                             alidade::opencv_window("OpenCV window 11", 11),
                                             {"OpenCV sectors, accurate", alidade::opencv_sectors}};
  fmt::print("Corners of rendered boards: 10×10 corners, 800×600, squares of 28 to 44 px; RMS per coordinate\n");
  for (const Condition& condition : {Condition{"blur 0.6, noise 2, <= 29 deg", 0.6, 2.0, 0.506},
                                     Condition{"blur 0.6, noise 6, <= 29 deg", 0.6, 6.0, 0.506},
                                     Condition{"blur 1.5, noise 2, <= 29 deg", 1.5, 2.0, 0.506},
                                     Condition{"blur 0.6, noise 2, <= 60 deg", 0.6, 2.0, 1.047}}) {
    alidade::run(condition, methods, 10);
  }
}
