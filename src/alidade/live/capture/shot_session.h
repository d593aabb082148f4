#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "alidade/board_detector/quick_look.h"
#include "alidade/capture.h"
#include "alidade/live/capture/kept_photos.h"

namespace alidade::live {

/// Shots of a rangefinder while they are taken: an image of the board and what the rangefinder read. On disk are
/// FOLDER/photos and FOLDER/shots.csv (range_m, photo), whole after each shot: `alidade rangefinder shots.csv` gives
/// the same beam afterwards. Knows no window and no network.
class ShotSession {
 public:
  /// With the shots of an earlier session, where there are photos. Throws ConfigError for a config or a camera that
  /// cannot be, InputError for shots that cannot be read.
  ShotSession(const Camera& camera, const RangefinderConfig& config, const ShotConfig& where, KeptPhotos photos);

  /// A first look at an image: the board in it, or why there is none.
  [[nodiscard]] QuickLook look(const cv::Mat& grey) { return looker_.look(grey); }
  /// Keeps an image with its reading, and solves. Why not, or "".
  std::string take(const cv::Mat& grey, double t_s, bool is_exact, double range_m);
  bool undo();

  [[nodiscard]] const ShotGuideState& state() const { return guide_.state(); }
  [[nodiscard]] const KeptPhotos& kept() const { return kept_; }
  [[nodiscard]] double begin_s() const { return begin_s_; }  ///< Time at which it goes on; 0 for a new one.
  /// √trace of the origin's covariance after each shot [m]; infinite before there is a beam.
  [[nodiscard]] const std::vector<double>& history_m() const { return history_m_; }
  [[nodiscard]] std::filesystem::path table() const { return kept_.folder().parent_path() / "shots.csv"; }

 private:
  struct Row {
    double range_m = 0.0;
    std::string photo;
  };
  void go_on();
  /// The shot of an image: board and spot as the whole job finds them. Empty `board`, with why, where it has none.
  [[nodiscard]] Shot measured(const cv::Mat& grey, double range_m) const;
  void write_table() const;

  Camera camera_;
  RangefinderConfig config_;
  QuickLooker looker_;
  ShotGuide guide_;
  KeptPhotos kept_;
  std::vector<Row> rows_;
  std::vector<double> history_m_;
  double begin_s_ = 0.0;
};

}  // namespace alidade::live
