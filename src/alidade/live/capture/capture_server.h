#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/live/server.h"

namespace alidade::live {

/// An image as a page sends it: 8-bit grey, row by row.
struct SentImage {
  int width_px = 0, height_px = 0;
  bool is_exact = false;  ///< The camera's own values; else as a canvas draws them.
  std::string grey;
};

/// What a page asks for: "take", "undo" …, with a number where one is needed: what a rangefinder read.
struct PageCommand {
  std::string op;
  std::optional<double> value = {};
};

/// The image of a message: u32 'ADY1', u32 width, u32 height, u32 exact, little-endian, then the grey values. None
/// where the message is something else, or its size is not that of its image.
[[nodiscard]] std::optional<SentImage> sent_image(std::string_view message);

/// Whether an Origin header is that of a page of this server: "http://127.0.0.1:8765". Programs send none.
[[nodiscard]] bool is_own_origin(std::string_view origin, std::string_view address, std::uint16_t port,
                                 std::string_view machine_name = {});

struct CaptureServerConfig {
  std::string address = "127.0.0.1";
  std::uint16_t port = 8765;                             ///< 0: any free one.
  std::function<HttpAnswer(std::string_view path)> get;  ///< Called by the server's thread.
};

/// The server of a capture: a page, and the socket /capture by which it sends images and receives what they show. It
/// writes, so everything asks for the token, the Host and, of browsers, the Origin: 403 without. One page is in
/// control, others watch; of images the newest waits, none is queued; too large ones, or too many, end a connection.
class CaptureServer {
 public:
  /// Listens. Throws InputError where that cannot be.
  explicit CaptureServer(CaptureServerConfig config);
  ~CaptureServer();
  CaptureServer(const CaptureServer&) = delete;
  CaptureServer& operator=(const CaptureServer&) = delete;

  /// With its token.
  [[nodiscard]] std::string url() const;
  [[nodiscard]] std::size_t num_clients() const;

  /// The newest image of the page in control that was not given yet; waits for one, not longer than that.
  [[nodiscard]] std::optional<SentImage> wait_for_image(std::chrono::milliseconds most);
  /// What the page in control has asked for since, in order.
  [[nodiscard]] std::vector<PageCommand> commands();
  /// A message for all pages. `kind`: one of each kind is kept for pages that come later; empty: none.
  void tell(std::string json, const std::string& kind = "");
  /// A JPEG for the pages that do not send images themselves.
  void show(std::string jpeg, bool also_control);
  /// Waits until what was sent is out and all pages have left; not longer.
  void finish(double max_s);

  struct State;

 private:
  std::unique_ptr<State> state_;
};

}  // namespace alidade::live
