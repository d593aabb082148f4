#include <tbb/parallel_for.h>

#include <limits>
#include <opencv2/imgproc.hpp>

#include "alidade/camera/camera_diff.h"
#include "alidade/camera/implied_motion.h"
#include "alidade/camera/undistort.h"
#include "alidade/estimation/config_error.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/camera_formats.h"
#include "python/bindings/bindings.h"
#include "python/bindings/ending.h"
#include "python/bindings/images.h"

namespace alidade::python {
namespace {

Array empty_array(std::vector<py::ssize_t> shape) { return Array(std::move(shape)); }

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t chunk = 4096;  // points that a thread takes at a time

/// `work(begin, end)` for parts of so many rows, on several threads where there are many.
template <class Work>
void in_parts(std::size_t num_rows, const Work& work) {
  if (num_rows <= chunk) return work(std::size_t{0}, num_rows);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, num_rows, chunk),
                    [&](const auto& part) { work(part.begin(), part.end()); });
}

template <int Size>
void put(const Eigen::Matrix<double, Size, 1>* value, double* to) {
  for (int i = 0; i < Size; ++i) to[i] = value ? (*value)[i] : none;
}

Array project_points(const Camera& camera, const Array& points) {
  const auto points_in_cam = vectors_of<3>(points);
  Array pixels = empty_array({points.shape(0), 2});
  double* const to = pixels.mutable_data();
  const Released released;
  in_parts(points_in_cam.size(), [&](std::size_t begin, std::size_t end) {
    const auto found = project(camera, points_in_cam.subspan(begin, end - begin));
    for (std::size_t i = begin; i < end; ++i) put<2>(found[i - begin] ? &*found[i - begin] : nullptr, to + 2 * i);
  });
  return pixels;
}

template <int Rows, int Cols, int MaxCols>
void put_matrix(const Eigen::Matrix<double, Rows, Cols, 0, Rows, MaxCols>* value, py::ssize_t cols, double* to) {
  for (int i = 0; i < Rows; ++i) {
    for (py::ssize_t j = 0; j < cols; ++j) to[i * cols + j] = value ? (*value)(i, j) : none;
  }
}

py::tuple project_points_with_jacobians(const Camera& camera, const Array& points) {
  const auto points_in_cam = vectors_of<3>(points);
  const py::ssize_t num_points = points.shape(0), num_params = params(camera.lens).size();
  Array pixels = empty_array({num_points, 2}), by_point = empty_array({num_points, 2, 3}),
        by_lens = empty_array({num_points, 2, num_params});
  double *const px = pixels.mutable_data(), *const J_point = by_point.mutable_data(),
                *const J_lens = by_lens.mutable_data();
  {
    const Released released;
    in_parts(points_in_cam.size(), [&](std::size_t begin, std::size_t end) {
      const auto found = project_with_jacobians(camera, points_in_cam.subspan(begin, end - begin));
      for (std::size_t i = begin; i < end; ++i) {
        const LensProjection* const at = found[i - begin] ? &*found[i - begin] : nullptr;
        put<2>(at ? &at->px : nullptr, px + 2 * i);
        put_matrix<2, 3, 3>(at ? &at->J_px_point : nullptr, 3, J_point + 6 * i);
        put_matrix<2, Eigen::Dynamic, 16>(at ? &at->J_px_params : nullptr, num_params,
                                          J_lens + 2 * static_cast<std::size_t>(num_params) * i);
      }
    });
  }
  return py::make_tuple(pixels, by_point, by_lens);
}

/// Origin [m] and unit direction of what each pixel sees.
py::tuple rays_of(const Camera& camera, const Array& px) {
  const auto pixels = vectors_of<2>(px);
  Array origins = empty_array({px.shape(0), 3}), directions = empty_array({px.shape(0), 3});
  double *const origin = origins.mutable_data(), *const direction = directions.mutable_data();
  {
    const Released released;
    in_parts(pixels.size(), [&](std::size_t begin, std::size_t end) {
      const auto rays = observation_rays(camera, pixels.subspan(begin, end - begin));
      for (std::size_t i = begin; i < end; ++i) {
        const ObservationRay* const ray = rays[i - begin] ? &*rays[i - begin] : nullptr;
        put<3>(ray ? &ray->origin_in_cam : nullptr, origin + 3 * i);
        put<3>(ray ? &ray->direction_in_cam : nullptr, direction + 3 * i);
      }
    });
  }
  return py::make_tuple(origins, directions);
}

Array sigma_of_pixels(const Camera& camera, const Array& px, double distance_m) {
  const auto pixels = vectors_of<2>(px);
  Array sigmas = empty_array({px.shape(0)});
  double* const to = sigmas.mutable_data();
  const Released released;
  const std::vector<double> found = detail::sigma_at(camera, pixels, distance_m);
  std::copy(found.begin(), found.end(), to);
  return sigmas;
}

Eigen::MatrixXd matrix_of(const Array& array) {
  if (array.size() == 0) return {};
  Eigen::MatrixXd matrix(array.shape(0), array.shape(1));
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) matrix(i, j) = array.at(i, j);
  }
  return matrix;
}

Lens lens_of(const std::string& model) {
  const std::optional<Lens> lens = make_lens(model);
  if (!lens) throw ConfigError("'" + model + "' is not one of pinhole, brown, kannala_brandt, flat_port");
  return *lens;
}

/// An image of the camera's size as the pinhole sees it; of its type.
py::array undistorted_image(const Camera& camera, const py::array& image) {
  const Photos photos = photos_of({"image"}, {image});
  const cv::Mat pixels = photos.load(0);
  py::array straight(image.dtype(), std::vector<py::ssize_t>(image.shape(), image.shape() + image.ndim()));
  cv::Mat to(pixels.rows, pixels.cols, pixels.type(), straight.mutable_data());
  const Released released;
  PixelMap map = undistortion_map(camera, undistorted_camera(camera));
  cv::remap(pixels, to, cv::Mat(pixels.rows, pixels.cols, CV_32F, map.u_px.data()),
            cv::Mat(pixels.rows, pixels.cols, CV_32F, map.v_px.data()), cv::INTER_LINEAR);
  return straight;
}

Camera camera_of(const std::string& model, int width_px, int height_px, const std::vector<double>& values,
                 const Array& covariance, double rms_px, std::string source) {
  const Lens lens = lens_of(model);
  if (params(lens).size() != static_cast<Eigen::Index>(values.size()))
    throw ConfigError("another number of parameters");
  const Eigen::VectorXd numbers = Eigen::Map<const Eigen::VectorXd>(values.data(), params(lens).size());
  return {width_px, height_px, with_params(lens, numbers), matrix_of(covariance), rms_px, std::move(source)};
}

Camera camera_of_opencv(const std::vector<double>& focal_centre, const std::vector<double>& coefficients,
                        bool is_fisheye, int width_px, int height_px) {
  Camera camera = is_fisheye ? detail::fisheye_camera(focal_centre, coefficients, "from_opencv", "dist")
                             : detail::opencv_camera(focal_centre, coefficients, "from_opencv", "dist");
  camera.width_px = width_px;
  camera.height_px = height_px;
  return camera;
}

py::dict grid_dict(const PixelGrid& grid) {
  py::dict made;
  Array values = empty_array({grid.rows, grid.cols});
  std::copy(grid.values.begin(), grid.values.end(), values.mutable_data());
  made["u_px"] = grid.u0_px;
  made["v_px"] = grid.v0_px;
  made["du_px"] = grid.du_px;
  made["dv_px"] = grid.dv_px;
  made["values"] = values;
  return made;
}

py::object diff_of(const Camera& a, const Camera& b, double distance_m) {
  std::optional<CameraDiff> diff;
  {
    const Released released;
    diff = diff_cameras(a, b, {.distance_m = distance_m});
  }
  if (!diff) return py::none();
  py::dict made;
  made["delta_u_px"] = grid_dict(diff->delta_u);
  made["delta_v_px"] = grid_dict(diff->delta_v);
  made["in_sigmas"] = grid_dict(diff->in_sigmas);
  made["rms_px"] = diff->rms_px;
  made["max_px"] = diff->max_px;
  made["rms_in_sigmas"] = diff->rms_in_sigmas;
  made["max_in_sigmas"] = diff->max_in_sigmas;
  return made;
}

}  // namespace

Array matrix_array(const Eigen::MatrixXd& matrix) {
  Array array = empty_array({matrix.rows(), matrix.cols()});
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) array.mutable_at(i, j) = matrix(i, j);
  }
  return array;
}

void bind_camera(py::module_& module) {
  py::class_<Camera>(module, "Camera", plain_type(), "A lens with its image size and covariance.")
      .def(py::init(&camera_of), py::arg("model"), py::arg("width"), py::arg("height"), py::arg("values"),
           py::arg("covariance"), py::arg("rms_px"), py::arg("source"))
      .def_readonly("width", &Camera::width_px)
      .def_readonly("height", &Camera::height_px)
      .def_readonly("rms_px", &Camera::rms_px)
      .def_readonly("source", &Camera::source)
      .def_property_readonly("model", [](const Camera& self) { return std::string(model_name(self.lens)); })
      .def_property_readonly("is_central", [](const Camera& self) { return is_central(self.lens); })
      .def_property_readonly("names", [](const Camera& self) { return param_names(self.lens); })
      .def_property_readonly("values",
                             [](const Camera& self) {
                               const Eigen::VectorXd values = params(self.lens);
                               return std::vector<double>(values.data(), values.data() + values.size());
                             })
      .def_property_readonly("covariance", [](const Camera& self) { return matrix_array(self.cov); })
      .def_property_readonly("distortion", [](const Camera& self) { return detail::distortion(self); })
      .def("project", &project_points)
      .def("project_with_jacobians", &project_points_with_jacobians)
      .def("rays", &rays_of)
      .def("sigma_px", &sigma_of_pixels)
      .def("diff", &diff_of)
      .def("undistort", &undistorted_image)
      .def("undistorted", [](const Camera& self) { return undistorted_camera(self); })
      .def("text", [](const Camera& self, const std::string& format,
                      bool lossy) { return camera_text(self, camera_format(format), lossy); })
      .def("write", [](const Camera& self, const std::string& file, const std::string& format, bool lossy) {
        write_camera(file, self, camera_format(format), lossy);
      });
  module.def("parameter_names", [](const std::string& model) { return param_names(lens_of(model)); });
  module.def("read_camera", [](const std::string& file) { return read_camera(file); });
  module.def("lens_doubt", [](const std::string& file) { return lens_doubt(file); });
  module.def("parse_camera", [](const std::string& text, const std::string& name) { return parse_camera(text, name); });
  module.def("camera_from_opencv", &camera_of_opencv);
}

}  // namespace alidade::python
