#include "alidade/files/files.h"
#include "alidade/heads/head_device.h"
#include "python/bindings/bindings.h"
#include "python/bindings/ending.h"

/// A head that is connected: asked, and moved where its owner allowed it. Calls end within the head's timeout, without
/// the GIL.
namespace alidade::python {
namespace {

using AxisPair = std::pair<double, double>;
Eigen::Vector2d vector_of(const AxisPair& pair) { return {pair.first, pair.second}; }
AxisPair pair_of(const Eigen::Vector2d& vector) { return {vector[0], vector[1]}; }

/// The device, and what holds it within its limits once it may move.
class ConnectedHead {
 public:
  ConnectedHead(const std::string& url, const std::string& password, bool moves, const AxisPair& pan_rad,
                const AxisPair& tilt_rad)
      : device_(open_head(url, {.password = password})) {
    if (!moves) return;
    held_ = std::make_unique<MovingHead>(*device_, Eigen::Vector2d(pan_rad.first, tilt_rad.first),
                                         Eigen::Vector2d(pan_rad.second, tilt_rad.second), Progress{});
    if ((held_->high_rad() - held_->low_rad()).maxCoeff() > 1e4)
      throw InputError(device_->name() + ": names no limits; give pan_range_rad and tilt_range_rad");
  }

  [[nodiscard]] py::dict limits() const {
    const HeadLimits limits = device_->limits();
    py::dict made;
    made["low_rad"] = pair_of(held_ ? held_->low_rad() : limits.low_rad);
    made["high_rad"] = pair_of(held_ ? held_->high_rad() : limits.high_rad);
    made["are_given"] = limits.are_given;
    made["are_told"] = limits.are_given;
    made["info"] = limits.info;
    return made;
  }
  [[nodiscard]] py::dict position() {
    HeadPosition reading;
    {
      const Released released;
      reading = held_ ? held_->position() : device_->position();
    }
    py::dict made;
    made["t_s"] = reading.t_s;
    made["wait_s"] = reading.wait_s;
    made["pan_tilt_rad"] = pair_of(reading.pan_tilt_rad);
    return made;
  }
  double command(const AxisPair& pan_tilt_rad) {
    if (!held_) throw InputError(device_->name() + ": may not move; open it with move=True");
    const Released released;
    return held_->command(vector_of(pan_tilt_rad)).t_s;
  }
  void stop() {
    const Released released;
    if (held_) held_->stop();
  }

 private:
  std::unique_ptr<HeadDevice> device_;
  std::unique_ptr<MovingHead> held_;
};

}  // namespace

void bind_head(py::module_& module) {
  py::class_<ConnectedHead, std::shared_ptr<ConnectedHead>>(module, "Head", plain_type())
      .def(py::init<const std::string&, const std::string&, bool, const AxisPair&, const AxisPair&>())
      .def("limits", &ConnectedHead::limits)
      .def("position", &ConnectedHead::position)
      .def("command", &ConnectedHead::command)
      .def("stop", &ConnectedHead::stop);
}

}  // namespace alidade::python
