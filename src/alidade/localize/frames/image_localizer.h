#pragma once

#include <cstdint>
#include <unordered_map>

#include "alidade/localize/engine.h"
#include "alidade/localize/frames/image_target.h"
#include "alidade/localize/frames/landmark.h"
#include "alidade/localize/frames/landmark_descriptions.h"
#include "alidade/localize/frames/still_parts.h"
#include "alidade/localize/path/keyframes.h"
#include "alidade/localize/path/whole_path.h"

namespace alidade {

/// Adapts a filter's configuration to images: tens of matches per frame, whose few mismatches the gates reject, and
/// features whose defining pixel is found again to `sigma_floor_px`.
[[nodiscard]] LocalizationFilterConfig for_images(LocalizationFilterConfig config, double sigma_floor_px);

/// The front end for images: finds the features of the filter's map in each image, selects new ones, and relocalises
/// the camera after it was lost.
class ImageLocalizer {
 public:
  /// `config` as returned by resolved(); it must outlive this.
  ImageLocalizer(const Camera& camera, const LocalizeConfig& config);

  /// The next image, 8-bit grey of the camera's size.
  PathStep take(const cv::Mat& grey, long frame, double t_s);
  /// `result` contains the path; the rest is filled in, and the path is smoothed.
  void sum_up(Localization& result) const;
  /// The matches in images, as kept for smoothing, and the target's points with the ids used there.
  [[nodiscard]] const std::vector<ObservationFrame>& frames() const { return kept_.frames(); }
  [[nodiscard]] std::span<const KnownPoint> target() const { return given_; }
  /// Fills the map for use in a later run, from `result` as returned.
  void save_map(Localization& result) const;
  /// Searches in the last image.
  [[nodiscard]] std::span<const ObservationTried> tried() const { return tried_; }

 private:
  struct Search {
    double min_correlation = 0.8;
    double extra_sigma_px = 0.0;
  };

  [[nodiscard]] PathStep taken(const cv::Mat& grey, const cv::Mat& smoothed, long frame, double t_s);
  bool start(const cv::Mat& smoothed);
  bool start_in_map(const cv::Mat& smoothed);
  void take_saved(const SavedMap& map);
  void enter_saved();
  [[nodiscard]] std::vector<StartHypothesis> likely_places(const cv::Mat& smoothed, double depth_m) const;
  void begin_at(std::span<const StartHypothesis> starts);
  [[nodiscard]] std::optional<SeenTarget> seen_target(const cv::Mat& smoothed) const;
  [[nodiscard]] const std::optional<SeenTarget>& target_now(const cv::Mat& smoothed);
  [[nodiscard]] bool may_mistake_corners() const;
  [[nodiscard]] const std::vector<FeatureObservation>* corners_of_board(const cv::Mat& smoothed);
  void take_corner(const std::vector<FeatureObservation>& corners, std::vector<FeatureObservation>& observations);
  void add_target(const cv::Mat& smoothed, const SeenTarget& seen);
  [[nodiscard]] std::vector<KnownPoint> given_points(const SeenTarget& seen) const;
  void predict_to(double t_s);
  /// Searches features of the map where they are predicted; `tried_` records each search.
  [[nodiscard]] std::vector<FeatureObservation> look(const cv::Mat& smoothed, const Search& search);
  [[nodiscard]] bool is_found(std::size_t num_found) const;
  void count(std::span<const FeatureObservation> observations, const ObservationsReport& report);
  void drop_bad();
  void add_new(const cv::Mat& smoothed);
  /// Returns whether it was added.
  bool add_landmark(const cv::Mat& smoothed, const Eigen::Vector2d& px, double depth_m);
  void close_loop(const cv::Mat& smoothed, double usual_depth_m);
  void recognise(const cv::Mat& smoothed);
  bool take_recognised(const cv::Mat& smoothed, const Rigid3& world_from_cam);
  void enter_again(const cv::Mat& smoothed, const LandmarkSeen& seen);
  [[nodiscard]] bool make_room();
  void let_go(long id);
  [[nodiscard]] double period_s() const { return config_.period_s > 0.0 ? config_.period_s : period_s_; }
  [[nodiscard]] Recording recording() const;
  void leave_out_joined(const WholePath& whole, Localization& result) const;
  [[nodiscard]] double usual_depth_m() const;
  [[nodiscard]] bool find_back(const cv::Mat& smoothed, PathStep& step);
  [[nodiscard]] bool try_from(const cv::Mat& smoothed, const StartHypothesis& start, PathStep& step);
  void forget(long id);
  void take_next(const cv::Mat& smoothed, PathStep& step);
  [[nodiscard]] bool shows_last(const cv::Mat& grey);
  [[nodiscard]] bool should_move() const;
  [[nodiscard]] bool restart_in_doubt(const cv::Mat& smoothed, PathStep& step);

  LocalizeEngine engine_;
  const LocalizeConfig& config_;
  std::unordered_map<long, Landmark> landmarks_;
  KeyframeStore keyframes_;
  std::vector<KnownPoint> given_;  ///< The target's points, as added to the filter.
  std::size_t num_alike_ = 1;
  [[nodiscard]] bool is_shown(const Eigen::Vector2d& px) const;

  ObservationRecord record_;
  KeptFrames kept_;  ///< Input of path smoothing.
  struct Gone {
    GonePoint point;
    Landmark landmark;
  };
  std::map<long, Gone> gone_;  ///< Points that left a full map.
  LandmarkDescriptions descriptions_;
  std::optional<Rigid3> last_described_;
  std::map<long, long> number_of_;  ///< Recognised landmark → the original one.
  std::map<long, long> latest_;     ///< Original landmark → its latest id.
  struct Saved {
    KnownPoint point;
    Landmark landmark;
  };
  std::map<long, Saved> saved_;          ///< Of the map of an earlier run; those not found are removed.
  std::vector<FeatureObservation> now_;  ///< Observations of this image's pose, and its new landmarks.
  std::size_t num_taken_ = 0;            ///< Number of images.
  ImageMask shown_;                      ///< See image_mask.h.
  bool lacks_circle_ = false;
  void mask(const cv::Mat& grey, const cv::Mat& smoothed);
  std::vector<std::uint8_t> last_image_;  ///< Row by row.
  bool is_repeated_ = false;              ///< This image is identical to the last one.
  std::size_t num_repeated_ = 0;
  StillParts still_;
  ImageMask given_mask_;                               ///< `shown_` without the mask of still parts.
  std::optional<std::optional<SeenTarget>> seen_now_;  ///< The target in this image; empty: not searched yet.
  std::vector<ObservationTried> tried_;
  std::vector<Eigen::Vector2d> in_view_;  ///< Pixels of landmarks found or predicted in this image.
  double t_s_ = 0.0, period_s_ = 0.0;
  long frame_ = 0, next_id_ = 0;
  std::size_t num_found_now_ = 0;
};

}  // namespace alidade
