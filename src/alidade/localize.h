#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "alidade/camera/camera.h"
#include "alidade/estimation/config_error.h"
#include "alidade/estimation/progress.h"
#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"
#include "alidade/localize/sequence.h"
#include "alidade/public.h"

/// Path of a moving camera and map of the points that it sees: everything that `alidade localize` does.
namespace alidade {
struct MovedMapPoints;
ALIDADE_PUBLIC_BEGIN

/// From observations of numbered points, frames in order of time. Throws ConfigError for an invalid config, camera or
/// frame, Interrupted if `progress` returns false, but never because of what the observations show. With `truth` the
/// result has the path's error. If the config gives no σ of a pixel, it is estimated first, from all frames.
[[nodiscard]] Localization localize(const ObservationTable& observations, const Camera& camera,
                                    const LocalizeConfig& config = {}, std::span<const TimedPose> truth = {},
                                    const Progress& progress = {});
[[nodiscard]] Localization localize(std::span<const ObservationFrame> frames, const Camera& camera,
                                    const LocalizeConfig& config = {}, std::span<const TimedPose> truth = {},
                                    const Progress& progress = {});

/// From images (8-bit grey, of the camera's size, in order of time): features are selected and tracked in them.
[[nodiscard]] Localization localize(const ImageStream& images, const Camera& camera, const LocalizeConfig& config = {},
                                    std::span<const TimedPose> truth = {}, const Progress& progress = {});

/// Incremental localize(), frame by frame. push() returns the filter's pose, with a σ of 0.5 px if the config gives
/// none; finish() returns what localize() returns for the same frames, to the last digit (for more than
/// config.max_smoothed frames, with the pixel σ of push()).
class Localizer {
 public:
  /// Throws ConfigError.
  explicit Localizer(const Camera& camera, const LocalizeConfig& config = {});
  ~Localizer();
  Localizer(Localizer&&) noexcept;
  Localizer& operator=(Localizer&&) noexcept;

  /// Processes the next frame: observations or images, not both. The state is unchanged if it throws ConfigError.
  const PathStep& push(const ObservationFrame& frame);
  const PathStep& push(const cv::Mat& grey, long frame, double t_s);
  /// Verdict of the filter on the poses that push() returned since the last call; throws ConfigError for images. If the
  /// lens is not as given, these poses are off by many times their σ, while finish() may correct that.
  [[nodiscard]] Verdict recent();
  /// The result so far; more frames may follow.
  [[nodiscard]] Localization finish(std::span<const TimedPose> truth = {}) const;

 private:
  struct Run;
  [[nodiscard]] std::optional<Localization> finished_without(MovedMapPoints moved,
                                                             std::span<const TimedPose> truth) const;
  void push_all(std::span<const ObservationFrame> frames, const Progress& progress);
  [[nodiscard]] Localization finished(std::span<const TimedPose> truth) const;
  [[nodiscard]] std::optional<Localization> by_found_sigma(double found_px, std::span<const ObservationFrame> frames,
                                                           LocalizeConfig config, std::span<const TimedPose> truth,
                                                           const Progress& progress) const;
  [[nodiscard]] Localization with_sigma_sought(std::span<const ObservationFrame> frames, LocalizeConfig config,
                                               std::span<const TimedPose> truth, const Progress& progress,
                                               const std::function<Localization()>& by_usual) const;
  friend Localization localize(std::span<const ObservationFrame> frames, const Camera& camera,
                               const LocalizeConfig& config, std::span<const TimedPose> truth,
                               const Progress& progress);
  std::unique_ptr<Run> run_;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
