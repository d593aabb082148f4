#pragma once

#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/board/board_view.h"
#include "alidade/calibrate/calibrate.h"
#include "alidade/camera/projection_sigma.h"
#include "alidade/description/field.h"
#include "alidade/estimation/config_error.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"
#include "alidade/rangefinder/shot_plan.h"
#include "alidade/rig/calibration.h"
#include "alidade/rig/plan/next_view.h"

namespace cv {
class Mat;
}

/// Guided capture of photos of a board: where to hold it, which images to keep, and when to stop.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

struct CaptureConfig {
  double until_px = 0.2;  ///< The goal: 3σ of projection at the worst pixel.
  /// True: images are those of a video, and a board is taken once it stands still. False: each is a separate photo.
  bool is_video = true;
  CalibrateConfig calibrate = {};
};

/// The field of `config` that a user sets: until_px, as "0.2px" or "0.2".
[[nodiscard]] FieldList fields_of(CaptureConfig& config);

/// What an image shows, and whether it is worth keeping.
enum class LookStatus {
  nothing,      ///< No board was found.
  other_board,  ///< A chessboard of a size other than the given one.
  moving,       ///< The board does not stand still yet.
  blurred,      ///< More blurred than the sharpest image so far.
  same_pose,    ///< The same pose as in a photo that is kept: it would have the same errors.
  little,       ///< It would hardly lower σ, or lower it by much less than the proposed pose.
  repeated,     ///< Identical to the previous image.
  useful,       ///< Worth keeping.
};

/// The name of a status: "nothing", "other_board" …
[[nodiscard]] std::string_view look_status_name(LookStatus status);

/// An earlier image.
struct EarlierImage {
  std::shared_ptr<const cv::Mat> image;  ///< Null if only corners were given.
  BoardView view;
  double t_s = 0.0;
};

/// What to do with an image.
struct CaptureLook {
  LookStatus status = LookStatus::nothing;
  std::string words;                        ///< One line for the user: what is wrong, or how to move the board.
  std::string words_mirrored;               ///< The same for a user who sees the image mirrored.
  std::vector<Eigen::Vector2d> corners_px;  ///< Distorted; empty where there is no board.
  int other_cols = 0, other_rows = 0;       ///< Size of the board found, for other_board.
  double gain = 0.0;                        ///< ln(σ now / σ with it), over the image; 0: unknown or none.
  std::optional<EarlierImage> earlier;      ///< To be kept instead of this image, because it is more informative.
  [[nodiscard]] bool take() const { return status == LookStatus::useful; }
};

/// Where to hold the board next.
struct NextPose {
  Rigid3 cam_from_board;
  std::vector<Eigen::Vector2d> outline_px;  ///< Outer corners, distorted by the lens.
  std::string words;                        ///< "near, in the upper left corner, the top tilted away"
  std::string words_mirrored;
};

/// Progress of the capture.
struct CaptureState {
  int photos = 0;           ///< Number of photos kept.
  bool has_camera = false;  ///< They determine a camera.
  Camera camera;            ///< With its covariance; before there is one, a guess without covariance.
  double worst_3sigma_px = std::numeric_limits<double>::infinity();
  Eigen::Vector2d worst_px = Eigen::Vector2d::Zero();  ///< The pixel at which it occurs.
  std::optional<int> photos_to_goal;                   ///< Photos probably still needed if the outlines are followed.
  std::optional<NextPose> next;
  PixelGrid sigma;                    ///< σ of projection over the image [px]; empty before there is a camera.
  std::vector<std::string> warnings;  ///< "the focal length drifts: …"
  [[nodiscard]] bool is_at(double goal_px) const { return has_camera && worst_3sigma_px <= goal_px; }
};

/// Judges images one by one, re-estimates the camera after each kept photo, and proposes where to hold the board next:
/// the pose that lowers σ over the image most, by the information matrix of the lens. Uses no files and no clock: times
/// are given with the images. Not thread-safe.
/// Richardson, Strom & Olson, "AprilCal", IROS 2013 (the idea); Fedorov 1972 (sequential design), see next_photo.h.
class CaptureGuide {
 public:
  /// Throws ConfigError for an invalid config or board.
  explicit CaptureGuide(const Board& board, const CaptureConfig& config = {});
  ~CaptureGuide();
  CaptureGuide(CaptureGuide&&) noexcept;
  CaptureGuide& operator=(CaptureGuide&&) noexcept;

  /// Judges an image (8- or 16-bit, grey or colour) at time `t_s`, which must not decrease. All images must have the
  /// size of the first; an image of another size is LookStatus::nothing.
  [[nodiscard]] CaptureLook look(const cv::Mat& image, double t_s);
  /// For times without new images: the best of the images so far, as `earlier`, if it is worth keeping at that time;
  /// otherwise not useful.
  [[nodiscard]] CaptureLook look_back(double t_s);
  /// Keeps an image, however little it helps, and re-estimates. Returns why it cannot be kept (no board in it), or "".
  [[nodiscard]] std::string take(const cv::Mat& image);
  /// look(), then take() if the image is useful.
  CaptureLook push(const cv::Mat& image, double t_s);
  /// The same for corners detected by other means, in images of this size.
  CaptureLook push(const BoardView& view, const ImageSize& size, double t_s);
  /// Discards a kept photo, by its index among them.
  void forget(std::size_t photo);

  [[nodiscard]] const CaptureState& state() const;
  /// Rescales σ from now on to that found by calibrate() for these photos; calibrate() also estimates the board's shape
  /// and detects the corners twice.
  void correct(double worst_3sigma_px);
  /// Whether an image counts as useful as soon as it lowers σ at all: for sources that will not provide a better image.
  void accept_any_useful(bool accept);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// What to measure next with a rangefinder beside the camera, and how well its beam is known.
struct ShotGuideState {
  int shots = 0;
  bool has_beam = false;
  Beam beam;                                                        ///< With its covariance; valid if has_beam.
  double sigma_origin_m = std::numeric_limits<double>::infinity();  ///< √trace of the origin's covariance.
  Verdict verdict;                                                  ///< For the shots so far.
  std::optional<NextShot> next;  ///< Where to hold the board; before there is a beam, only `words` says it.
  std::vector<Eigen::Vector2d> outline_px = {};  ///< Outline of the board in that pose, distorted by the lens.
  std::string words;                             ///< "1.5 m away, tilted by 30°, the right side farther"
};

/// The same guidance for a rangefinder: shots arrive one by one, each is followed by rangefinder() on all of them, and
/// the next shot is the first one of plan_shots(). Before three shots, or while they do not determine the beam, it
/// proposes poses that differ as much as a beam requires.
class ShotGuide {
 public:
  /// Throws ConfigError for an invalid config or camera.
  explicit ShotGuide(Camera camera, RangefinderConfig config = {}, ShotConfig where = {});

  /// Adds a shot and solves. Throws ConfigError for an invalid shot, which is then not added.
  const ShotGuideState& push(const Shot& shot);
  void undo();
  [[nodiscard]] const ShotGuideState& state() const { return state_; }

 private:
  void solve();

  Camera camera_;
  RangefinderConfig config_;
  ShotConfig where_;
  std::vector<Shot> shots_;
  ShotGuideState state_;
};

/// Where to point heads that rotate next, and how well their axes are known.
struct ViewGuideState {
  int views = 0;
  bool has_rig = false;
  Rig rig;  ///< With its covariance; valid if has_rig.
  /// σ of the cameras' relative pose, the worst over the angles of the config; infinite: not known yet.
  RigSigma sigma = {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  Verdict verdict;                               ///< For the views so far.
  std::optional<NextView> next;                  ///< Before there is a rig, only `words` says it.
  std::vector<Eigen::Vector2d> outline_px = {};  ///< Outline of the board in that pose, in the image of that head.
  std::string words;  ///< "head 1 to pan 12.0°, tilt -5.0°: board 2 in the upper left corner of its image"
};

/// The same guidance for heads: views of boards arrive one by one, each is followed by rig() on all of them, and the
/// next view is that of plan_view(). Before there is a rig, it proposes views that differ as much as its axes require.
class ViewGuide {
 public:
  /// `cameras`: by head id. `config.board` must be given. Throws ConfigError for invalid cameras or config.
  explicit ViewGuide(std::map<int, Camera> cameras, RigConfig config, ViewConfig where = {});

  /// Adds a view and solves. Throws ConfigError for an invalid view, which is then not added.
  const ViewGuideState& push(const HeadView& view);
  void undo();
  [[nodiscard]] const ViewGuideState& state() const { return state_; }

 private:
  void solve();

  std::map<int, Camera> cameras_;
  RigConfig config_;
  ViewConfig where_;
  std::vector<HeadView> views_;
  ViewGuideState state_;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
