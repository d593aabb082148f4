#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "alidade/pantilt/rig.h"
#include "alidade/results/outcome.h"

namespace alidade {

/// σ of the position of a head's base, along the world's axes. [m]
[[nodiscard]] Eigen::Vector3d sigma_of_base(const Rig& rig, const Eigen::MatrixXd& cov, std::size_t h);

/// Adds the heads of a rig to a result, with their σ and covariance.
void fill_heads(const Rig& rig, ResultDocument& document);

/// Adds `stddev_model`, their σ for independent errors of single measurements.
void fill_heads_model(const Rig& rig, const Eigen::MatrixXd& cov_model, ResultDocument& document);

/// Adds rig.yaml, and camera_ID.yaml for each head.
void add_rig_files(const Rig& rig, std::vector<NamedBytes>& files);

}  // namespace alidade
