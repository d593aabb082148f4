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

/// Photos of a board, chosen while they are taken: where to hold it, which image to keep, and when to stop.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

struct CaptureConfig {
  double until_px = 0.2;  ///< The goal: 3σ at the worst pixel.
  /// Images follow each other as in a video: a board is taken when it stands still. Else each is a photo by itself.
  bool is_video = true;
  CalibrateConfig calibrate = {};
};

/// The field of `config` that a user sets: until_px, "0.2px" or "0.2".
[[nodiscard]] FieldList fields_of(CaptureConfig& config);

/// What an image shows, and whether it is worth keeping.
enum class LookStatus {
  nothing,      ///< No board.
  other_board,  ///< A chessboard of another size than was given.
  moving,       ///< The board has not stood still yet.
  blurred,      ///< Blurred, compared with the sharpest so far.
  same_pose,    ///< As in a photo that is kept already: its errors would be the same.
  little,       ///< It would lower σ by next to nothing, or by much less than the proposed pose.
  repeated,     ///< The same image as before, to the bit.
  useful,       ///< Worth keeping.
};

/// The word for it: "nothing", "other_board" …
[[nodiscard]] std::string_view look_status_name(LookStatus status);

/// An image that was shown before.
struct EarlierImage {
  std::shared_ptr<const cv::Mat> image;  ///< Null where corners alone were given.
  BoardView view;
  double t_s = 0.0;
};

/// What to do with an image.
struct CaptureLook {
  LookStatus status = LookStatus::nothing;
  std::string words;                        ///< To the person, one line: what is wrong, or how to move the board.
  std::string words_mirrored;               ///< The same for a person who sees the image mirrored.
  std::vector<Eigen::Vector2d> corners_px;  ///< As seen; empty where there is no board.
  int other_cols = 0, other_rows = 0;       ///< Of other_board.
  double gain = 0.0;                        ///< ln(σ now / σ with it), over the image; 0: unknown or none.
  std::optional<EarlierImage> earlier;      ///< To be taken instead of this one: it is more informative.
  [[nodiscard]] bool take() const { return status == LookStatus::useful; }
};

/// Where to hold the board next.
struct NextPose {
  Rigid3 cam_from_board;
  std::vector<Eigen::Vector2d> outline_px;  ///< Of the outer corners, as the lens distorts it.
  std::string words;                        ///< "near, in the upper left corner, the top tilted away"
  std::string words_mirrored;
};

/// How far the capture is.
struct CaptureState {
  int photos = 0;           ///< Kept.
  bool has_camera = false;  ///< They determine one.
  Camera camera;            ///< With its covariance; before there is one, a guess without.
  double worst_3sigma_px = std::numeric_limits<double>::infinity();
  Eigen::Vector2d worst_px = Eigen::Vector2d::Zero();  ///< Where that is.
  std::optional<int> photos_to_goal;                   ///< Likely still needed, if the outlines are followed.
  std::optional<NextPose> next;
  PixelGrid sigma;                    ///< σ over the image [px]; no values before there is a camera.
  std::vector<std::string> warnings;  ///< "the focal length drifts: …"
  [[nodiscard]] bool is_at(double goal_px) const { return has_camera && worst_3sigma_px <= goal_px; }
};

/// Judges images one by one, solves after each that is kept, and proposes where to hold the board next: the pose that
/// lowers σ over the image most, by the information matrix of the lens. Uses no files and no clock: times are given
/// with the images. One thread at a time.
/// Richardson, Strom & Olson, "AprilCal", IROS 2013 (the idea); Fedorov 1972 (sequential design), see next_photo.h.
class CaptureGuide {
 public:
  /// Throws ConfigError for an invalid config or board.
  explicit CaptureGuide(const Board& board, const CaptureConfig& config = {});
  ~CaptureGuide();
  CaptureGuide(CaptureGuide&&) noexcept;
  CaptureGuide& operator=(CaptureGuide&&) noexcept;

  /// Judges an image (8- or 16-bit, grey or colour) of time `t_s`, which must not decrease. All have the size of the
  /// first; an image of another size is LookStatus::nothing.
  [[nodiscard]] CaptureLook look(const cv::Mat& image, double t_s);
  /// For times without new images: the best of the images shown so far, as `earlier`, if it is worth keeping at that
  /// time; else not useful.
  [[nodiscard]] CaptureLook look_back(double t_s);
  /// Keeps an image, however little it helps, and solves. Returns why it cannot be kept (no board in it), else "".
  [[nodiscard]] std::string take(const cv::Mat& image);
  /// look(), and take() if the image is useful.
  CaptureLook push(const cv::Mat& image, double t_s);
  /// The same with corners detected by other means, in images of that size.
  CaptureLook push(const BoardView& view, const ImageSize& size, double t_s);
  /// Forgets a photo that was kept, by its number among them.
  void forget(std::size_t photo);

  [[nodiscard]] const CaptureState& state() const;
  /// The σ that calibrate(), which also estimates the board's shape and extracts the corners twice, found for these
  /// photos: from now on σ is scaled to it.
  void correct(double worst_3sigma_px);
  /// Whether an image is useful as soon as it lowers σ at all: for sources from which no better image will come.
  void accept_any_useful(bool accept);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// What to shoot next with a rangefinder beside the camera, and how well its beam is known.
struct ShotGuideState {
  int shots = 0;
  bool has_beam = false;
  Beam beam;                                                        ///< With its covariance, where there is one.
  double sigma_origin_m = std::numeric_limits<double>::infinity();  ///< √trace of the origin's covariance.
  Verdict verdict;                                                  ///< On the shots so far.
  std::optional<NextShot> next;  ///< Where to hold the board; before there is a beam, its words alone say it.
  std::vector<Eigen::Vector2d> outline_px = {};  ///< Of the board there, as the lens shows it.
  std::string words;                             ///< "1.5 m away, tilted by 30°, the right side farther"
};

/// The same guidance for a rangefinder: shots come one by one, each solve is that of rangefinder() on all of them, and
/// the next shot is the first of plan_shots(). Before three shots, or where they do not determine it, poses that differ
/// as much as a beam needs.
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

/// Where to look next with heads that rotate, and how well their axes are known.
struct ViewGuideState {
  int views = 0;
  bool has_rig = false;
  Rig rig;  ///< With its covariance, where there is one.
  /// σ of the cameras' relative pose, the worst over the angles of the config; infinite: not known yet.
  RigSigma sigma = {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  Verdict verdict;                               ///< On the views so far.
  std::optional<NextView> next;                  ///< Before there is a rig, the words alone say it.
  std::vector<Eigen::Vector2d> outline_px = {};  ///< Of the board there, in the image of that head.
  std::string words;  ///< "head 1 to pan 12.0°, tilt -5.0°: board 2 in the upper left corner of its image"
};

/// The same guidance for heads: views of boards come one by one, each solve is that of rig() on all of them, and the
/// next view is that of plan_view(). Before there is a rig, views that differ as much as its axes need.
class ViewGuide {
 public:
  /// `cameras`: by id of the head. `config.board` must be given. Throws ConfigError for invalid cameras or config.
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
