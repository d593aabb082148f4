#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>

namespace cv {
class Mat;
}

namespace alidade {

/// `colour`: a blob of one colour, whatever its brightness; `bright`, `dark`: a blob against the rest of the image;
/// `pattern`: an image of the target; `marker`: an ArUco marker or AprilTag.
enum class TargetKind { colour, bright, dark, pattern, marker };

/// What the target looks like.
struct TargetLook {
  TargetKind kind = TargetKind::bright;
  Eigen::Vector3d rgb = Eigen::Vector3d::Zero();  ///< colour: 0 to 255; what counts is its hue.
  std::string dictionary = {};                    ///< marker: DICT_4X4_50, DICT_APRILTAG_36h11, …
  int marker_id = 0;
  double min_snr = 8.0;           ///< colour, bright, dark: of the blob over the image's noise.
  double rival_share = 0.5;       ///< A second blob with this share of the first one's light is a rival.
  double min_correlation = 0.7;   ///< pattern: below it the target is lost.
  double min_margin = 0.1;        ///< pattern: by which it matches better than any other position.
  double max_radius_share = 0.3;  ///< colour, bright, dark: of the image's shorter side; what is larger is no target.
};

/// Where the target should be.
struct TargetExpectation {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 0.0;  ///< It is looked for within 4 σ, and of two that are alike the nearer one is taken.
};

/// Where the target is in an image, or the reason why it is lost.
struct TargetDetection {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();   ///< Its centre.
  Eigen::Matrix2d cov = Eigen::Matrix2d::Zero();  ///< By the image's noise and pixels. [px²]
  double score = 0.0;      ///< 0 … 1: pattern: the correlation; blobs: 1 − 6 noise / contrast; marker: 1.
  double radius_px = 0.0;  ///< Of a circle of its area.
  std::string reason;  ///< "not in the image", "two candidates at (u, v) and (u, v)", …; empty where it was found.
  [[nodiscard]] bool found() const { return reason.empty(); }
};

/// Finds one target in image after image. A pattern may grow and shrink from one to the next by 10 %; nothing else
/// is remembered, so that a lost target is found again.
class TargetDetector {
 public:
  /// `pattern`: for that kind, a grey or colour image of the target, filled by it. Throws std::invalid_argument: a
  /// colour without hue, an unknown dictionary or marker, a pattern smaller than 8 pixels a side or without contrast.
  explicit TargetDetector(const TargetLook& look, const cv::Mat* pattern = nullptr);
  TargetDetector(TargetDetector&&) noexcept;
  TargetDetector& operator=(TargetDetector&&) noexcept;
  ~TargetDetector();

  /// Frame: 8-bit BGR or grey, or 32-bit float grey of 0 to 255. A colour requires BGR.
  [[nodiscard]] TargetDetection find(const cv::Mat& frame, const std::optional<TargetExpectation>& expected = {});

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace alidade
