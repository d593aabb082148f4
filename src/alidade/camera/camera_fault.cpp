#include "alidade/camera/camera_fault.h"

#include "alidade/geometry/covariance.h"

namespace alidade {

std::string fault(const Camera& camera) {
  if (camera.width_px < 1 || camera.height_px < 1) return "the camera's image size must be given";
  const Eigen::VectorXd lens = params(camera.lens);
  if (!lens.allFinite() || !(lens.head<2>().minCoeff() > 0.0)) {
    return "the camera's parameters must be finite, fx and fy above 0";
  }
  if (camera.cov.size() == 0) return "";
  const bool is_of_lens = camera.cov.rows() == lens.size() && camera.cov.cols() == lens.size();
  if (!is_of_lens || !camera.cov.allFinite())
    return "the camera's covariance must be finite, of all parameters of the lens";
  return is_covariance(camera.cov) ? "" : "the camera's covariance is not symmetric, or has a negative variance";
}

}  // namespace alidade
