#include "alidade/camera/camera_fault.h"

namespace alidade {

std::string fault(const Camera& camera) {
  if (camera.width_px < 1 || camera.height_px < 1) return "the camera's image size must be given";
  const Eigen::VectorXd lens = params(camera.lens);
  if (!lens.allFinite() || !(lens.head<2>().minCoeff() > 0.0)) {
    return "the camera's parameters must be finite, fx and fy above 0";
  }
  const bool has_cov = camera.cov.size() > 0;
  const bool is_cov = camera.cov.rows() == lens.size() && camera.cov.cols() == lens.size() && camera.cov.allFinite();
  return has_cov && !is_cov ? "the camera's covariance must be finite, of all parameters of the lens" : "";
}

}  // namespace alidade
