#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/live/protocol.h"
#include "alidade/live/rate_limit.h"
#include "alidade/live/send_queue.h"

namespace alidade::live {

/// How messages of a topic are kept for clients that connect later, and which are dropped first if one is too slow.
enum class TopicKind {
  steps,   ///< Those of the last minute are kept.
  images,  ///< The newest is kept; dropped before steps.
  latest,  ///< Each replaces the previous one: a scene, a calibration. Never dropped.
};

struct Topic {
  Channel channel;
  TopicKind kind = TopicKind::steps;
  double max_hz = 60.0;   ///< Messages per second, over all lanes.
  std::size_t lanes = 1;  ///< Number of lanes with separate shares: heads, none of which may starve another.
};

struct KeptMessage {
  std::uint64_t t_ns = 0;  ///< Time of the message.
  double at_s = 0.0;       ///< When it was sent.
  std::shared_ptr<const std::string> body;
};

/// The topics of a server with their limits and kept messages. Limits may be queried by any thread, the rest belongs to
/// the server's thread.
class TopicStore {
 public:
  explicit TopicStore(const std::vector<Topic>& topics);

  static constexpr std::size_t none = static_cast<std::size_t>(-1);
  [[nodiscard]] std::size_t size() const { return topics_.size(); }
  [[nodiscard]] std::size_t index_of(std::string_view name) const;
  [[nodiscard]] bool lets_through(std::size_t index, std::size_t lane, double now_s);
  [[nodiscard]] MessageKind kind_of(std::size_t index) const;
  [[nodiscard]] std::vector<Channel> channels() const;

  void keep(std::size_t index, KeptMessage message);
  [[nodiscard]] const std::deque<KeptMessage>& kept(std::size_t index) const { return topics_[index]->kept; }

 private:
  struct State {
    Topic topic;
    std::mutex mutex;  ///< Protects the limits.
    std::vector<RateLimit> limits;
    std::deque<KeptMessage> kept;
  };
  std::vector<std::unique_ptr<State>> topics_;
};

/// One client of the server, without its socket: its subscriptions, and the messages that wait for it.
class Feed {
 public:
  Feed(const TopicStore& topics, std::string_view session_id);

  /// A message from the client. Never throws: errors are answered with a status.
  void hear(std::string_view text);
  void warn(std::string_view what);
  /// Sends to all its subscriptions of a topic.
  void offer(std::size_t index, const KeptMessage& message);
  void tell(StatusLevel level, std::string_view message);
  /// Replaces one that is still waiting.
  void tell_time(std::uint64_t t_ns);

  [[nodiscard]] bool has_next() const { return !queue_.is_empty(); }
  [[nodiscard]] Outgoing next() { return queue_.pop(); }
  /// Reports at most every two seconds what was dropped.
  void note_dropped(double now_s);
  [[nodiscard]] bool subscribes_to(std::size_t index) const;
  [[nodiscard]] const SendQueue& queue() const { return queue_; }

 private:
  void subscribe(std::uint32_t subscription, std::uint64_t channel);
  void push(std::uint32_t subscription, std::size_t index, const KeptMessage& message);

  const TopicStore& topics_;
  std::vector<std::pair<std::uint32_t, std::size_t>> subscriptions_;
  SendQueue queue_;
  double noted_at_s_ = -1e300;
};

}  // namespace alidade::live
