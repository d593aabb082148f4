#pragma once

#include <unordered_map>

#include "alidade/localize/engine.h"
#include "alidade/localize/filter/landmark.h"
#include "alidade/localize/frames/image_target.h"
#include "alidade/localize/path/keyframes.h"

namespace alidade {

/// A filter's configuration as images need it: tens of matches a frame, whose few mismatches the gates keep out, and
/// features defined by a pixel that is found again to `sigma_floor_px`.
[[nodiscard]] LocalizationFilterConfig for_images(LocalizationFilterConfig config, double sigma_floor_px);

/// The front end for images: finds the features of the filter's map in each, chooses new ones, and finds the way back
/// after it was lost.
class ImageLocalizer {
 public:
  /// `config` as resolved() gives it; it must live longer.
  ImageLocalizer(const Camera& camera, const LocalizeConfig& config);

  /// The next image, 8-bit grey of the camera's size.
  PathStep take(const cv::Mat& grey, long frame, double t_s);
  /// `result` has the path; the rest is filled in.
  void sum_up(Localization& result) const;
  /// Of the last image.
  [[nodiscard]] std::span<const ObservationTried> tried() const { return tried_; }

 private:
  struct Search {
    double min_correlation = 0.8;
    double extra_sigma_px = 0.0;
  };

  bool start(const cv::Mat& smoothed);
  void begin_at(std::span<const StartHypothesis> starts);
  [[nodiscard]] std::optional<SeenTarget> seen_target(const cv::Mat& smoothed) const;
  void add_target(const cv::Mat& smoothed, const SeenTarget& seen);
  [[nodiscard]] std::vector<KnownPoint> given_points(const SeenTarget& seen) const;
  void predict_to(double t_s);
  /// What of the map is found where it is expected; `tried_` says what was looked for.
  [[nodiscard]] std::vector<FeatureObservation> look(const cv::Mat& smoothed, const Search& search);
  [[nodiscard]] bool is_found(std::size_t num_found) const;
  void count(std::span<const FeatureObservation> observations, const ObservationsReport& report);
  void drop_bad();
  void add_new(const cv::Mat& smoothed);
  [[nodiscard]] bool make_room();
  [[nodiscard]] double usual_depth_m() const;
  [[nodiscard]] bool find_back(const cv::Mat& smoothed, PathStep& step);
  [[nodiscard]] bool try_from(const cv::Mat& smoothed, const StartHypothesis& start, PathStep& step);
  void forget(long id);
  void take_next(const cv::Mat& smoothed, PathStep& step);
  [[nodiscard]] bool restart_in_doubt(const cv::Mat& smoothed, PathStep& step);

  LocalizeEngine engine_;
  const LocalizeConfig& config_;
  std::unordered_map<long, Landmark> landmarks_;
  KeyframeStore keyframes_;
  std::vector<KnownPoint> given_;  ///< The target's points, as the filter was given them.
  std::size_t num_alike_ = 1;
  [[nodiscard]] bool is_shown(const Eigen::Vector2d& px) const;

  ImageMask shown_;  ///< image_mask.h.
  bool lacks_circle_ = false;
  std::vector<ObservationTried> tried_;
  std::vector<Eigen::Vector2d> in_view_;  ///< Where landmarks are, or should be, in this image.
  double t_s_ = 0.0, period_s_ = 0.0;
  long frame_ = 0, next_id_ = 0;
  std::size_t num_found_now_ = 0;
};

}  // namespace alidade
