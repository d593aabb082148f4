#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace alidade::live {

struct LiveFrame {
  int width_px = 0, height_px = 0;
  std::vector<unsigned char> grey;
};

/// A camera of the machine or of the network, read by a thread of its own: of its frames the newest counts, those that
/// nobody fetched in time are skipped.
class NewestFrame {
 public:
  /// Throws InputError where the address gives no frames.
  explicit NewestFrame(const std::string& address);
  ~NewestFrame();
  NewestFrame(const NewestFrame&) = delete;
  NewestFrame& operator=(const NewestFrame&) = delete;

  /// One that was not fetched yet; none while there is no newer one.
  [[nodiscard]] std::optional<LiveFrame> fetch();
  /// The stream has ended, or broke off, and its last frame was fetched.
  [[nodiscard]] bool is_over() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace alidade::live
