#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "alidade/calibrate.h"
#include "alidade/description/field.h"
#include "alidade/localize.h"
#include "alidade/observe.h"
#include "alidade/rangefinder.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/study/trial.h"
#include "alidade/track.h"

/// The settings that can be studied: what is drawn, and which estimator has to find it. Of each: its fields, its trials
/// (setting_of), and one trial with all that it leaves (trial_of).
namespace alidade {

/// A camera that sways as Fang et al. 2011, eq. (27), and sees static points. fx 710, fy 700, cx 390, cy 290.
struct ObserveStudy {
  static constexpr const char* name = "observe";
  static constexpr std::uint64_t block = 5000;

  /// batch: TurningAdjustment alone, for many trials. The others: observe(), the whole job with its verdict.
  std::string method = "batch";
  int rows = 200;
  double rate_hz = 30.0;
  int points = 4;
  double noise_px = 0.3;
  int scenes = 16;  ///< Sets of points, one after the other.
};
struct ObserveTrial {
  RotationLog log;
  ObserveConfig config;
};

/// Photos of a board by a camera with distortion; corners with normal noise, and errors that a photo's corners share.
struct CalibrateStudy {
  static constexpr const char* name = "calibrate";
  static constexpr std::uint64_t block = 50;

  int photos = 12;
  double noise_px = 0.1;
  double shared_px = 0.0;
  std::string model = "brown";
  BoardShape board_shape = BoardShape::automatic;  ///< As it is estimated; the simulated board is flat.
  int scenes = 12;                                 ///< Sets of poses, one after the other; 0: each trial its own.
  bool sigma_map = false;                          ///< Also what the σ map says of 20 pixels.
  bool judge = false;                              ///< The whole job with its verdict; false: the solve alone.
};
struct CalibrateTrial {
  std::vector<BoardView> views;
  Board board;
  ImageSize size;
  Camera truth;
};

/// Shots of a rangefinder beside a camera, of a scenario of `simulate rangefinder`; lens known as a calibration knows
/// it.
struct RangefinderStudy {
  static constexpr const char* name = "rangefinder";
  static constexpr std::uint64_t block = 50;

  std::string scenario = "reference";
  std::string method = "joint";
  std::string refine = "all";
  int shots = 18;
  double noise_px = 0.3;  ///< Of the spot.
  double corner_noise_px = 0.2;
  double noise_m = 0.002;  ///< Of a reading.
  bool judge = false;      ///< The whole job with its verdict; false: the solve alone.
};
struct RangefinderTrial {
  std::vector<Shot> shots;
  Camera camera;
  RangefinderConfig config;
  Beam truth;
};

/// A target that two heads follow, of a scenario of `simulate track`: where it is at the end.
struct TrackStudy {
  static constexpr const char* name = "track";
  static constexpr std::uint64_t block = 50;

  std::string scenario = "B";
  std::string method = "cv";
  double noise_px = 0.5;
  double noise_rad = 0.0008726646259971648;  ///< Of an encoder.
  double duration_s = 5.0;
};
struct TrackTrial {
  std::vector<TargetObservation> observations;
  Rig rig;
  TrackConfig config;
  TrueTrack truth;
};

/// A camera that swings in front of a board under water, of `simulate underwater`: where it is at the end.
struct LocalizeStudy {
  static constexpr const char* name = "localize";
  static constexpr std::uint64_t block = 10;

  int points = 8;
  int frames = 35;
  double noise_px = 0.5;
  double depth_sigma = 0.03;  ///< Of an unknown point's initial depth, relative.
};
struct LocalizeTrial {
  std::vector<ObservationFrame> frames;
  Camera camera;
  LocalizeConfig config;
  std::vector<TimedPose> truth;
};

/// Photos of a camera rotated by hand: other cameras, rotations and points in each trial, and possible faults.
struct TurnedStudy {
  static constexpr const char* name = "turned";
  static constexpr std::uint64_t block = 10;

  double wrong_matches = 0.0;  ///< Share.
  double moving_points = 0.0;  ///< Share of the points that each photo sees elsewhere.
  double lever_m = 0.0;        ///< Camera centre from the centre of rotation, along the view.
  double step_m = 0.0;         ///< σ of the hand's own steps.
  double focus = 0.0;          ///< By which the focal length walks, relative.
  bool on_the_spot = false;    ///< And given as such: no parallax is included.
};
struct TurnedTrial {
  MatchedPhotos photos;
  ObserveConfig config;
  Eigen::Vector4d truth;  ///< fx, fy, cx, cy. [px]
};

/// σ at the end of a chain: photos of a board give two lenses, views of boards through these give a rig of two heads,
/// and with that rig a target is followed: where it is at the end.
struct ChainStudy {
  static constexpr const char* name = "chain";
  static constexpr std::uint64_t block = 10;

  double range_m = 3.0;  ///< Of the target; the heads stand 0.5 m apart.
  int photos = 13;       ///< Of each camera.
  bool exact = false;    ///< Rig and lenses are taken as exact: σ without the chain.
};

[[nodiscard]] FieldList fields_of(ObserveStudy& study);
[[nodiscard]] FieldList fields_of(CalibrateStudy& study);
[[nodiscard]] FieldList fields_of(RangefinderStudy& study);
[[nodiscard]] FieldList fields_of(TrackStudy& study);
[[nodiscard]] FieldList fields_of(LocalizeStudy& study);
[[nodiscard]] FieldList fields_of(TurnedStudy& study);
[[nodiscard]] FieldList fields_of(ChainStudy& study);

/// Throw ConfigError for settings that cannot be.
[[nodiscard]] StudySetting setting_of(const ObserveStudy& study, std::uint64_t seed);
[[nodiscard]] StudySetting setting_of(const CalibrateStudy& study, std::uint64_t seed);
[[nodiscard]] StudySetting setting_of(const RangefinderStudy& study, std::uint64_t seed);
[[nodiscard]] StudySetting setting_of(const TrackStudy& study, std::uint64_t seed);
[[nodiscard]] StudySetting setting_of(const LocalizeStudy& study, std::uint64_t seed);
[[nodiscard]] StudySetting setting_of(const TurnedStudy& study, std::uint64_t seed);
[[nodiscard]] StudySetting setting_of(const ChainStudy& study, std::uint64_t seed);

[[nodiscard]] ObserveTrial trial_of(const ObserveStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] CalibrateTrial trial_of(const CalibrateStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] RangefinderTrial trial_of(const RangefinderStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] TrackTrial trial_of(const TrackStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] LocalizeTrial trial_of(const LocalizeStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] TurnedTrial trial_of(const TurnedStudy& study, std::uint64_t seed, std::uint64_t trial);
/// None where a step of the chain before the track has no answer.
[[nodiscard]] std::optional<TrackTrial> trial_of(const ChainStudy& study, std::uint64_t seed, std::uint64_t trial);

}  // namespace alidade
