#include "alidade/board_detector/find_board.h"

#include <opencv2/core.hpp>

#include "alidade/board/dictionary.h"
#include "alidade/board_detector/chessboard_corners.h"
#include "alidade/board_detector/kinds/chessboard.h"
#include "alidade/board_detector/kinds/circle_grid.h"
#include "alidade/board_detector/kinds/marker_board.h"
#include "alidade/imaging/grey_photo.h"

namespace alidade {
namespace {

BoardDetection find_chessboard_corners(const cv::Mat& photo, const Board& board, bool reject_partial) {
  const Chessboard coarse = find_chessboard(photo, board.cols, board.rows);
  if (!coarse.reason.empty()) return not_found(coarse.reason);
  BoardDetection detection = fit_chessboard(photo, board, coarse);
  const std::size_t seen = detection.view.corners.size();
  if (reject_partial && detection.found() && seen < static_cast<std::size_t>(num_points(board))) {
    return not_found("only " + std::to_string(seen) + " of " + std::to_string(num_points(board)) + " corners");
  }
  return detection;
}

}  // namespace

BoardDetection not_found(std::string reason) { return {.view = {}, .reason = std::move(reason)}; }

BoardDetection find_board(const cv::Mat& photo, const Board& board, bool reject_partial) {
  std::string reason = fault(board);
  if (!reason.empty()) return not_found(std::move(reason));
  const cv::Mat grey = to_grey_photo(photo, reason);
  if (!reason.empty()) return not_found(std::move(reason));
  switch (board.kind) {
    case BoardKind::chessboard:
      return find_chessboard_corners(grey, board, reject_partial);
    case BoardKind::charuco:
    case BoardKind::aprilgrid:
      return find_marker_board(grey, board);
    case BoardKind::circles:
    case BoardKind::asymmetric_circles:
      return find_circle_grid(grey, board);
  }
  return not_found("this kind of board is not supported");
}

BoardDetection refind_board(const cv::Mat& photo, const Board& board, const BoardView& first, const Camera& camera,
                            const Rigid3& cam_from_board) {
  std::string reason;
  const cv::Mat grey = to_grey_photo(photo, reason);
  if (!reason.empty()) return not_found(std::move(reason));
  switch (board.kind) {
    case BoardKind::chessboard:
      break;
    case BoardKind::charuco:
    case BoardKind::aprilgrid:
      return refind_marker_board(grey, board, first, camera, cam_from_board);
    case BoardKind::circles:
    case BoardKind::asymmetric_circles:
      return refind_circle_grid(grey, board, first, camera, cam_from_board);
  }
  return refit_chessboard(grey, board, first, camera, cam_from_board);
}

}  // namespace alidade
