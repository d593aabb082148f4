#include "alidade/heads/protocols/rotctl_head.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <optional>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/heads/protocols/line_socket.h"

namespace alidade {
namespace {

class RotctlHead final : public HeadDevice {
 public:
  RotctlHead(const std::string& url, const HeadOptions& options)
      : name_(url),
        clock_(machine_clock()),
        timeout_s_(options.timeout_s),
        socket_(address_of(url, "rotctl://", 4533), options.timeout_s) {
    socket_.connect();
    read_limits();
  }

  [[nodiscard]] HeadLimits limits() override { return limits_; }
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] HeadClock& clock() override { return *clock_; }

  [[nodiscard]] HeadPosition position() override {
    socket_.begin_exchange(timeout_s_);
    socket_.connect();
    const double asked_s = clock_->now_s();
    socket_.write("p\n");
    const double azimuth = angle(socket_.line()), elevation = angle(socket_.line());
    const double answered_s = clock_->now_s();
    return {0.5 * (asked_s + answered_s), answered_s - asked_s, Eigen::Vector2d(0.0 - azimuth, elevation) * degree};
  }

  HeadSent command(const Eigen::Vector2d& pan_tilt_rad) override {
    if (!limits_.hold(pan_tilt_rad)) throw InputError(name_ + ": a command that is no angle within its limits");
    (void)position();  // Hamlib's dummy loses what it has moved since the last question
    return send(fmt::format("P {:.6f} {:.6f}\n", -pan_tilt_rad[0] / degree, pan_tilt_rad[1] / degree));
  }

  HeadSent stop() override {
    for (int attempt = 0;; ++attempt) {
      try {
        return send("S\n");
      } catch (const InputError&) {
        if (attempt == 2) throw;
        socket_.close();
      }
    }
  }

 private:
  HeadSent send(const std::string& line) {
    socket_.begin_exchange(timeout_s_);
    socket_.connect();
    const double sent_s = clock_->now_s();
    socket_.write(line);
    const std::string answer = socket_.line();
    const double answered_s = clock_->now_s();
    if (answer != "RPRT 0") {
      if (!answer.starts_with("RPRT")) socket_.close();  // the answers may be off by one
      throw InputError(fmt::format("{}: answers '{}' to '{}'", name_, answer.substr(0, 40),
                                   std::string_view(line).substr(0, line.size() - 1)));
    }
    return {sent_s, answered_s - sent_s};
  }

  double angle(const std::string& line) {
    const std::optional<double> value = finite_number(line);
    if (value && std::abs(*value) < 1e6) return *value;
    socket_.close();
    throw InputError(name_ + ": '" + line.substr(0, 40) + "' is no angle of a head");
  }

  void read_limits() {
    socket_.begin_exchange(4.0 * timeout_s_);
    socket_.write("\\dump_state\n");
    std::optional<double> min_az, max_az, min_el, max_el;
    const auto take = [&](const std::string& line, const char* key, std::optional<double>& value) {
      if (line.starts_with(key)) value = angle(line.substr(std::string_view(key).size()));
    };
    for (int i = 0; i < 100; ++i) {
      std::string line;
      try {
        line = socket_.line();
      } catch (const InputError&) {  // older ones say no "done"
        socket_.close();
        break;
      }
      take(line, "min_az=", min_az);
      take(line, "max_az=", max_az);
      take(line, "min_el=", min_el);
      take(line, "max_el=", max_el);
      if (line == "done" || line.starts_with("RPRT")) break;
    }
    limits_.info = "rotctld";
    if (!min_az || !max_az || !min_el || !max_el || !(*min_az < *max_az && *min_el < *max_el)) return;
    limits_.are_given = true;
    limits_.low_rad = Eigen::Vector2d(-*max_az, *min_el) * degree;
    limits_.high_rad = Eigen::Vector2d(-*min_az, *max_el) * degree;
  }

  std::string name_;
  std::shared_ptr<HeadClock> clock_;
  double timeout_s_;
  LineSocket socket_;
  HeadLimits limits_;
};

}  // namespace

std::unique_ptr<HeadDevice> open_rotctl(const std::string& url, const HeadOptions& options) {
  return std::make_unique<RotctlHead>(url, options);
}

}  // namespace alidade
