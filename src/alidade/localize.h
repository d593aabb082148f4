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

/// The path of a moving camera and the map of the points that it sees: the whole job, as `alidade localize` does it.
namespace alidade {
struct MovedMapPoints;
ALIDADE_PUBLIC_BEGIN

/// From observations of numbered points, frames in order of time. Throws ConfigError for an invalid config,
/// camera or frame, Interrupted where `progress` returns false; never for what the observations show. With `truth` the
/// result has the path's error. Where the config says no σ of a pixel, it is estimated first, from all frames.
[[nodiscard]] Localization localize(const ObservationTable& observations, const Camera& camera,
                                    const LocalizeConfig& config = {}, std::span<const TimedPose> truth = {},
                                    const Progress& progress = {});
[[nodiscard]] Localization localize(std::span<const ObservationFrame> frames, const Camera& camera,
                                    const LocalizeConfig& config = {}, std::span<const TimedPose> truth = {},
                                    const Progress& progress = {});

/// From images, 8-bit grey and of the camera's size, in order of time: features are selected and tracked in them.
[[nodiscard]] Localization localize(const ImageStream& images, const Camera& camera, const LocalizeConfig& config = {},
                                    std::span<const TimedPose> truth = {}, const Progress& progress = {});

/// The same, incrementally, frame by frame. push() returns the filter's pose, with 0.5 px where the config says no σ of
/// a pixel; finish() returns what localize() returns for the same frames, to the last digit (of more than
/// config.max_smoothed, with the σ that push() has).
class Localizer {
 public:
  /// Throws ConfigError.
  explicit Localizer(const Camera& camera, const LocalizeConfig& config = {});
  ~Localizer();
  Localizer(Localizer&&) noexcept;
  Localizer& operator=(Localizer&&) noexcept;

  /// The next frame: observations or images, but not both. If it throws ConfigError, the state is unchanged.
  const PathStep& push(const ObservationFrame& frame);
  const PathStep& push(const cv::Mat& grey, long frame, double t_s);
  /// Whether the poses that push() gave since this was last asked stand, by what the filter knows: of observations, not
  /// of images. Where the lens is not as given they are off by many times their σ, while finish() may correct that.
  [[nodiscard]] Verdict recent();
  /// The result so far; more may follow.
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
