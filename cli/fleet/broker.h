#pragma once

#include <nats/nats.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace alidade::fleet {

/// Where the broker is, and how to be let in.
struct BrokerOptions {
  std::string url = "nats://127.0.0.1:4222";
  std::string credentials, ca, certificate, key;  ///< Files; empty: none.
};

template <typename Type, void (*destroy)(Type*)>
struct Destroyer {
  void operator()(Type* object) const { destroy(object); }
};
using Message = std::unique_ptr<natsMsg, Destroyer<natsMsg, natsMsg_Destroy>>;
using Subscription = std::unique_ptr<natsSubscription, Destroyer<natsSubscription, natsSubscription_Destroy>>;
using KeyValues = std::unique_ptr<kvStore, Destroyer<kvStore, kvStore_Destroy>>;

/// A message to be stored, and what came of it.
struct Publication {
  std::string subject, payload;
  std::map<std::string, std::string> headers;
  bool is_stored = false;
  std::uint64_t sequence = 0;  ///< In its stream.
};

/// A connection to NATS with JetStream. What cannot be is thrown as InputError, a server without JetStream as well; a
/// connection that is lost comes back.
class Broker {
 public:
  explicit Broker(const BrokerOptions& options);
  ~Broker();
  Broker(const Broker&) = delete;
  Broker& operator=(const Broker&) = delete;

  /// Makes the streams that are not there: ALIDADE_OBS, ALIDADE_STATE, ALIDADE_ALARM. False: not now.
  [[nodiscard]] bool make_streams();
  /// A bucket; `ttl_s` 0: keys stay.
  [[nodiscard]] KeyValues bucket(const std::string& name, double ttl_s);
  /// None: it is not there.
  [[nodiscard]] KeyValues existing_bucket(const std::string& name);

  /// A stream's messages from a sequence number on, in order, and new ones. None: not now.
  [[nodiscard]] Subscription read(const std::string& stream, const std::string& subject, std::uint64_t from);
  /// The next message within so long; none: there is none, or the subscription has ended (`is_lost`).
  [[nodiscard]] static Message next(const Subscription& from, int wait_ms, bool& is_lost);
  /// What is published on a subject from now on, stored or not.
  [[nodiscard]] Subscription listen(const std::string& subject);
  /// Number of messages and last sequence number of a stream; none: not now.
  [[nodiscard]] std::optional<std::pair<std::uint64_t, std::uint64_t>> extent(const std::string& stream);

  /// Sends all of them and waits until the broker has stored each, refused it, timed out, or it is to stop. True: all
  /// are stored.
  bool store(std::vector<Publication>& messages, int wait_ms, const std::function<bool()>& goes_on = {});

  /// Times that the connection came back.
  [[nodiscard]] int num_reconnects() const { return reconnects_; }
  [[nodiscard]] bool is_connected() const { return natsConnection_Status(connection_) == NATS_CONN_STATUS_CONNECTED; }

 private:
  void require_jetstream(const BrokerOptions& options);

  std::atomic<int> reconnects_{0};
  natsConnection* connection_ = nullptr;
  jsCtx* jetstream_ = nullptr;
  std::string inbox_;
  Subscription acks_;
  std::uint64_t num_stores_ = 0;
};

/// Stream sequence number and how many are waiting behind a message of a stream.
struct Place {
  std::uint64_t sequence = 0, pending = 0;
};
[[nodiscard]] std::optional<Place> place_of(const Message& message);
/// "cam.ID.obs" → ID.
[[nodiscard]] std::string camera_of(const char* subject);

}  // namespace alidade::fleet
