#include "alidade/calibrate/calibrate_photos.h"

#include <algorithm>

#include "alidade/calibrate/repeated_views.h"

namespace alidade {
namespace {

std::string text(const PhotoSize& size) { return std::to_string(size.width_px) + "x" + std::to_string(size.height_px); }

/// Takes over what was found; photos of another size than the first are left out.
void take_detections(BoardDetections&& found, PhotoCalibration& result) {
  PhotoSize first;
  for (std::size_t i = 0; i < found.photos.size(); ++i) {
    const PhotoSize& size = found.sizes[i];
    if (size.width_px == 0) ++result.num_unreadable;
    if (first.width_px == 0) first = size;
    if (found.photos[i].found() && (size.width_px != first.width_px || size.height_px != first.height_px)) {
      result.reasons[i] = "is " + text(size) + ", but the first photo is " + text(first);
    } else if (found.photos[i].found()) {
      result.views[i].corners = std::move(found.photos[i].view.corners);
    } else {
      result.reasons[i] = found.photos[i].reason;
    }
  }
  result.size = {first.width_px, first.height_px};
  const auto repeats = repeated_views(result.views);
  for (std::size_t i = 0; i < repeats.size(); ++i) {
    if (!repeats[i]) continue;
    result.reasons[i] = "is the same picture as " + result.views[*repeats[i]].photo;
    result.views[i].corners.clear();
  }
}

/// Where many photos show a whole grid of another size, the few in which the asked one was seen are parts of that grid:
/// no camera comes from a wrong board. The sentence for it; empty where the board is right.
std::string wrong_board(const PhotoCalibration& result) {
  std::size_t others = 0, found = 0;
  std::string example;
  for (std::size_t i = 0; i < result.views.size(); ++i) {
    found += result.views[i].corners.empty() ? 0u : 1u;
    if (!result.reasons[i].starts_with("a grid of ")) continue;
    ++others;
    example = result.reasons[i];
  }
  if (others < 2 || 3 * others < found) return "";
  return std::to_string(others) + " photos show " + example;
}

/// Adds the corners of the first extraction that the second lost: where the lens model fits badly, the second starts
/// too far off, and these corners are the ones that tell.
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
  take_detections(find_boards(names.size(), load_photo, board, false, progress), result);

  if (const std::string wrong = wrong_board(result); !wrong.empty()) {
    result.report.reason = wrong;
    result.report.to_add = "check --board, which counts inner corners";
    result.report.views.resize(names.size());
    for (std::size_t i = 0; i < names.size(); ++i) {
      result.report.views[i].corners.resize(result.views[i].corners.size());
      result.report.views[i].reason = result.reasons[i].empty() ? "no camera: " + wrong : result.reasons[i];
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
