#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>

namespace alidade::live {

/// Kind of a message, which decides what is dropped first if a client reads too slowly.
enum class MessageKind {
  image,    ///< Dropped first,
  step,     ///< then these,
  control,  ///< never these: greetings, statuses, what replaces its older self (scene, calibration).
};

struct Outgoing {
  MessageKind kind = MessageKind::step;
  bool is_text = false;
  std::string head;                         ///< Sent before the body.
  std::shared_ptr<const std::string> body;  ///< Shared by all clients; null: nothing behind the head.
  std::uint32_t replaces = 0;               ///< For control messages: an older one with the same number > 0 is removed.

  [[nodiscard]] std::size_t size() const { return head.size() + (body ? body->size() : 0); }
};

/// Messages that wait for one client, in order and limited in bytes: a client that stops reading costs memory of
/// that size, and no time.
class SendQueue {
 public:
  explicit SendQueue(std::size_t max_bytes) : max_bytes_(max_bytes) {}

  /// Drops the oldest images, then the oldest steps, if it does not fit otherwise.
  void push(Outgoing message);
  [[nodiscard]] Outgoing pop();
  [[nodiscard]] bool is_empty() const { return waiting_.empty(); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

  /// Number of messages dropped since the last call.
  struct Dropped {
    std::size_t images = 0, steps = 0;
  };
  [[nodiscard]] Dropped take_dropped();
  [[nodiscard]] bool has_dropped() const { return dropped_.images + dropped_.steps > 0; }

 private:
  bool drop_oldest(MessageKind kind);

  std::size_t max_bytes_, bytes_ = 0;
  std::deque<Outgoing> waiting_;
  Dropped dropped_;
};

}  // namespace alidade::live
