#pragma once

#include "alidade/observe/checks/cause_scores.h"

namespace alidade {

/// Derivatives of a pixel by every parameter that is assumed exact, one column per scalar.
class CauseColumns {
 public:
  struct Group {
    std::string name;
    std::vector<int> columns;
    double from_s = not_seen;  ///< For a step: its instant [s].
  };
  struct Column {
    std::string member, unit;
    double ordinary = 1.0;  ///< σ of its typical size.
  };

  CauseColumns(const RotationLog& log, const Adjustment& reference, const CauseConfig& config);

  [[nodiscard]] int size() const { return static_cast<int>(columns_.size()); }
  [[nodiscard]] const std::vector<Group>& groups() const { return groups_; }
  [[nodiscard]] const Column& column(int i) const { return columns_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const CommonLayout& layout() const { return base_; }

  void begin_frame(int frame);
  /// For one observation: the predicted pixel, and J by the estimated parameters, by the point and by the causes.
  [[nodiscard]] bool at(const BundleObservation& seen, RotationPrediction& p, Eigen::Ref<Eigen::MatrixXd> by_causes);
  /// J by the rotation of the frame, for the observation of the last call of at().
  [[nodiscard]] Eigen::Matrix<double, 2, 3> by_rotation() const {
    return wide_prediction_.J_px_common.middleCols<3>(wide_.rotation);
  }

 private:
  void add(const std::string& group, const std::string& member, double ordinary, const std::string& unit = "");
  void add_lens();
  void add_lever();
  void add_zoom();
  void add_steps();
  void fill_lens(const Eigen::Vector3d& in_cam, Eigen::Ref<Eigen::MatrixXd> out) const;

  const Adjustment& reference_;
  CommonLayout base_, wide_;
  double height_;
  std::vector<TurnPattern> patterns_;
  std::vector<std::size_t> row_of_frame_;
  std::vector<int> lever_column_;   ///< Per point: column of its own parallax; −1: none.
  std::vector<int> across_column_;  ///< Per point: first of two columns, parallax across the view; −1: none.
  std::vector<Group> groups_;
  std::vector<Column> columns_;
  int first_k1_ = -1, first_mount_ = -1, first_delay_ = -1, shutter_ = -1, drift_ = -1, first_pattern_ = -1,
      first_lever_ = -1, first_zoom_ = -1, first_step_ = -1;
  std::vector<double> steps_s_;
  std::optional<RotationView> view_;
  int frame_ = 0;
  double frame_time_s_ = 0.0;
  Eigen::Matrix3d cam_from_start_, mount_from_cam_;
  RotationPrediction wide_prediction_;
};

}  // namespace alidade
