#pragma once

#include <Eigen/Core>
#include <string>

#include "alidade/report/svg.h"

namespace alidade::report {

/// Appends the ellipse of so many σ of a covariance in paper units. Nothing where it is no covariance.
void append_ellipse(std::string& d, Place centre, const Eigen::Matrix2d& cov, double sigmas);

/// √ of the larger eigenvalue; NaN where it is no covariance.
[[nodiscard]] double larger_sigma(const Eigen::Matrix2d& cov);

}  // namespace alidade::report
