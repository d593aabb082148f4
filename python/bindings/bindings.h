#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/results/outcome.h"

/// The module `_alidade`: values and jobs for the Python half of the package (python/alidade), which checks shapes,
/// names and documents. Arrays come in as C-contiguous float64, N × 2 or N × 3.
namespace alidade::python {

namespace py = pybind11;
using Array = py::array_t<double, py::array::c_style>;

/// Where a job's result is kept: what it leaves, the camera it estimated, if it did, and the covariance of that camera
/// as if every corner erred by itself.
struct Outcome {
  JobOutcome job;
  std::optional<Camera> camera;
  Eigen::MatrixXd model_covariance;
};
using OutcomePtr = std::shared_ptr<Outcome>;

/// The rows of an N × Size array, seen as vectors; the array must outlive them.
template <int Size>
[[nodiscard]] std::span<const Eigen::Matrix<double, Size, 1>> vectors_of(const Array& array) {
  using Vector = Eigen::Matrix<double, Size, 1>;
  static_assert(sizeof(Vector) == Size * sizeof(double));
  if (array.ndim() != 2 || array.shape(1) != Size) throw std::logic_error("array of another shape");
  return {reinterpret_cast<const Vector*>(array.data()), static_cast<std::size_t>(array.shape(0))};
}

/// Classes are of type `type`, as a stub says.
[[nodiscard]] inline py::metaclass plain_type() {
  return py::metaclass(py::reinterpret_borrow<py::object>(reinterpret_cast<PyObject*>(&PyType_Type)));
}

/// A text in which names of files may stand, which need not be UTF-8: such bytes as `errors` says, by default as
/// os.fsdecode has them.
[[nodiscard]] inline py::str text_of(const std::string& text, const char* errors = "surrogateescape") {
  return py::reinterpret_steal<py::str>(
      PyUnicode_DecodeUTF8(text.data(), static_cast<py::ssize_t>(text.size()), errors));
}

[[nodiscard]] Array matrix_array(const Eigen::MatrixXd& matrix);

void bind_board(py::module_& module);
void bind_calibrate(py::module_& module);
void bind_camera(py::module_& module);
void bind_capture(py::module_& module);
void bind_commands(py::module_& module);
void bind_head(py::module_& module);
void bind_images(py::module_& module);
void bind_live(py::module_& module);
void bind_localizer(py::module_& module);
void bind_outcome(py::module_& module);
void bind_waiting(py::module_& module);

}  // namespace alidade::python
