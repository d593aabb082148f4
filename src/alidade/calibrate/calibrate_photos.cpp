#include "alidade/calibrate/calibrate_photos.h"

#include <algorithm>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <utility>

#include "alidade/board/same_place.h"
#include "alidade/board_detector/board_guess.h"

namespace alidade {
namespace {

std::string text(const PhotoSize& size) { return std::to_string(size.width_px) + "x" + std::to_string(size.height_px); }

bool is_same(const PhotoSize& a, const PhotoSize& b) { return a.width_px == b.width_px && a.height_px == b.height_px; }

/// The size that most photos have; of two that are as frequent, the one that shows the board more often, then the
/// first.
PhotoSize usual_size(const BoardDetections& found) {
  PhotoSize usual;
  std::pair<std::size_t, std::size_t> most{0, 0};
  for (const PhotoSize& size : found.sizes) {
    if (size.width_px == 0 || is_same(size, usual)) continue;
    std::pair<std::size_t, std::size_t> count{0, 0};
    for (std::size_t i = 0; i < found.sizes.size(); ++i) {
      if (!is_same(found.sizes[i], size)) continue;
      ++count.first;
      count.second += found.photos[i].found() ? 1 : 0;
    }
    if (count <= most) continue;
    most = count;
    usual = size;
  }
  return usual;
}

/// Why a photo of another size takes no part.
std::string other_size(const PhotoSize& size, const PhotoSize& usual) {
  const bool is_turned = size.width_px == usual.height_px && size.height_px == usual.width_px;
  return "is " + text(size) + ", but most photos are " + text(usual) +
         (is_turned ? ": its pixels were turned; take it from the camera as it was stored" : "");
}

/// Takes over what was found; photos of another size than most are rejected. Returns the photos of that size that show
/// no board.
std::vector<std::size_t> take_detections(BoardDetections&& found, PhotoCalibration& result) {
  std::vector<std::size_t> in_vain;
  const PhotoSize usual = usual_size(found);
  for (std::size_t i = 0; i < found.photos.size(); ++i) {
    const PhotoSize& size = found.sizes[i];
    if (size.width_px == 0) ++result.num_unreadable;
    if (size.width_px != 0 && !is_same(size, usual)) {
      result.reasons[i] = other_size(size, usual);
    } else if (found.photos[i].found()) {
      result.views[i].corners = std::move(found.photos[i].view.corners);
    } else {
      result.reasons[i] = found.photos[i].reason;
      if (size.width_px != 0) in_vain.push_back(i);
    }
  }
  result.size = {usual.width_px, usual.height_px};
  const auto repeats = repeated_views(result.views);
  for (std::size_t i = 0; i < repeats.size(); ++i) {
    if (!repeats[i]) continue;
    result.reasons[i] = "is the same image as " + result.views[*repeats[i]].photo;
    result.views[i].corners.clear();
  }
  return in_vain;
}

/// The board that the photos show where it is not the one given.
std::optional<WrongBoard> given_wrongly(const std::vector<std::size_t>& in_vain, const PhotoLoader& load_photo,
                                        const Board& given, const Progress& progress, const PhotoCalibration& result) {
  const auto found = static_cast<std::size_t>(std::count_if(
      result.views.begin(), result.views.end(), [](const BoardView& view) { return !view.corners.empty(); }));
  if (auto wrong = wrong_board(result.reasons, found, in_vain, load_photo, given, progress)) return wrong;
  return smaller_board(result.views, given);
}

/// Adds the corners of the first extraction that the second lost: where the lens model fits badly, the second starts
/// too far off, and these corners are the informative ones.
void keep_missing(const std::vector<Corner>& first, std::vector<Corner>& again) {
  for (const Corner& corner : first) {
    const auto same = [&](const Corner& other) { return other.index == corner.index; };
    if (std::none_of(again.begin(), again.end(), same)) again.push_back(corner);
  }
  std::sort(again.begin(), again.end(), [](const Corner& a, const Corner& b) { return a.index < b.index; });
}

/// Replaces the corners of every photo that the first calibration used by those of the second extraction.
void extract_again(const PhotoLoader& load_photo, const Board& board, const CalibrateReport& first,
                   const Progress& progress, PhotoCalibration& result) {
  std::vector<KnownBoard> known(result.views.size());
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (first.views[i].used) known[i] = {&result.views[i], first.views[i].cam_from_board};
  }
  auto again = refind_boards(known, load_photo, board, first.camera, progress);
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (known[i].first == nullptr || !again[i].found() || again[i].view.corners.empty()) continue;
    keep_missing(result.views[i].corners, again[i].view.corners);
    result.views[i].corners = std::move(again[i].view.corners);
  }
}

}  // namespace

PhotoCalibration calibrate_photos(const std::vector<std::string>& names, const PhotoLoader& load_photo,
                                  const Board& board, const CalibrateConfig& config,
                                  std::span<const Eigen::Vector3d> given_points, const Progress& progress) {
  PhotoCalibration result;
  result.reasons.resize(names.size());
  for (const std::string& name : names) result.views.push_back({.photo = name, .corners = {}});
  const auto in_vain = take_detections(find_boards(names.size(), load_photo, board, false, progress), result);

  if (const auto wrong = given_wrongly(in_vain, load_photo, board, progress, result)) {
    result.report.reason = wrong->reason;
    result.report.to_add = wrong->to_add;
    result.report.views.resize(names.size());
    for (std::size_t i = 0; i < names.size(); ++i) {
      result.report.views[i].corners.resize(result.views[i].corners.size());
      result.report.views[i].reason = result.reasons[i].empty() ? "no camera: " + wrong->reason : result.reasons[i];
    }
    return result;
  }
  CalibrateConfig flat = config;
  if (config.board_shape != BoardShape::given) flat.board_shape = BoardShape::flat;
  const CalibrateReport first = calibrate(board, result.views, result.size, flat, given_points);
  if (first.status == CalibrateReport::Status::converged) {
    extract_again(load_photo, board, first, progress, result);
  }
  result.report = calibrate(board, result.views, result.size, config, given_points);
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!result.reasons[i].empty()) result.report.views[i].reason = result.reasons[i];
  }
  return result;
}

}  // namespace alidade
