#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "alidade/heads/simulated_head.h"
#include "alidade/heads/streams/frame_stream.h"

namespace alidade {

struct HeadServerConfig {
  SimulatedHeadConfig head;
  SimulatedCamera camera;
  std::string address = "127.0.0.1";
  int rotctl_port = -1, stream_port = -1, onvif_port = -1;  ///< 0: any free port; −1: not served.
  std::string user, password;                               ///< For ONVIF; no user: open to everybody.
  std::string truth_csv;                                    ///< File for the true positions, line by line; empty: none.
};

/// A simulated head behind the protocol of Hamlib's rotctld, its camera as motion JPEG over HTTP
/// (/stream.mjpg; X-Timestamp is the exposure time), and as an ONVIF camera. At most 16 clients each. Throws
/// InputError: a port is in use, the file cannot be written.
class HeadServer {
 public:
  explicit HeadServer(const HeadServerConfig& config);
  ~HeadServer();
  HeadServer(const HeadServer&) = delete;
  HeadServer& operator=(const HeadServer&) = delete;

  [[nodiscard]] std::uint16_t rotctl_port() const;
  [[nodiscard]] std::uint16_t stream_port() const;
  [[nodiscard]] std::uint16_t onvif_port() const;
  [[nodiscard]] std::size_t num_frames() const;
  [[nodiscard]] HeadPlant& plant();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The reply of rotctld to a line; none: the client quits.
[[nodiscard]] std::optional<std::string> rotctl_answer(HeadPlant& plant, const std::string& line, double t_s);

}  // namespace alidade
