#include "cli/fleet/broker.h"

#include <fmt/format.h>

#include <chrono>
#include <cstring>
#include <string_view>
#include <thread>

#include "alidade/files/files.h"

namespace alidade::fleet {
namespace {

constexpr std::int64_t second_ns = 1'000'000'000;
constexpr std::size_t window = 2000;  // messages on their way at once

[[noreturn]] void fail(const BrokerOptions& options, natsStatus status) {
  const char* detail = nats_GetLastError(nullptr);
  const bool has_detail = detail != nullptr && *detail != '\0';
  throw InputError(options.url + ": " + natsStatus_GetText(status) + (has_detail ? std::string(": ") + detail : "") +
                   "; is a NATS server with JetStream there? nats-server -a 127.0.0.1 -js -sd DIR");
}

struct OptionsHolder {
  natsOptions* options = nullptr;
  ~OptionsHolder() { natsOptions_Destroy(options); }
};

void on_reconnected(natsConnection*, void* count) { ++*static_cast<std::atomic<int>*>(count); }

natsStatus set_options(natsOptions* to, const BrokerOptions& options, std::atomic<int>& reconnects) {
  natsStatus s = natsOptions_SetURL(to, options.url.c_str());
  if (s == NATS_OK) s = natsOptions_SetName(to, "alidade-fleet");
  if (s == NATS_OK) s = natsOptions_SetMaxReconnect(to, -1);
  if (s == NATS_OK) s = natsOptions_SetReconnectWait(to, 200);
  if (s == NATS_OK) s = natsOptions_SetReconnectJitter(to, 50, 50);
  if (s == NATS_OK) s = natsOptions_SetReconnectedCB(to, on_reconnected, &reconnects);
  if (s == NATS_OK && !options.credentials.empty())
    s = natsOptions_SetUserCredentialsFromFiles(to, options.credentials.c_str(), nullptr);
  if (s == NATS_OK && !options.ca.empty()) s = natsOptions_LoadCATrustedCertificates(to, options.ca.c_str());
  if (s == NATS_OK && !options.certificate.empty())
    s = natsOptions_LoadCertificatesChain(to, options.certificate.c_str(), options.key.c_str());
  if (s == NATS_OK && (!options.ca.empty() || !options.certificate.empty())) s = natsOptions_SetSecure(to, true);
  return s;
}

/// The number behind a name in a JSON text of the broker's own.
std::optional<std::uint64_t> number_behind(std::string_view text, std::string_view name) {
  const std::size_t at = text.find(name);
  if (at == std::string_view::npos) return std::nullopt;
  return std::strtoull(text.data() + at + name.size(), nullptr, 10);
}

}  // namespace

Broker::Broker(const BrokerOptions& options) {
  OptionsHolder holder;
  natsStatus s = natsOptions_Create(&holder.options);
  if (s == NATS_OK) s = set_options(holder.options, options, reconnects_);
  if (s == NATS_OK) s = natsConnection_Connect(&connection_, holder.options);
  if (s != NATS_OK) fail(options, s);
  jsOptions js;
  jsOptions_Init(&js);
  js.Wait = 5000;
  s = natsConnection_JetStream(&jetstream_, connection_, &js);
  natsInbox* inbox = nullptr;
  if (s == NATS_OK) s = natsInbox_Create(&inbox);
  if (s == NATS_OK) {
    inbox_ = inbox;
    natsInbox_Destroy(inbox);
    acks_ = listen(inbox_ + ".*");
    if (!acks_) s = NATS_ERR;
  }
  if (s != NATS_OK) fail(options, s);
  require_jetstream(options);
}

/// A server that has just started may not have it yet. Other answers (a cluster without a leader) are waited for later.
void Broker::require_jetstream(const BrokerOptions& options) {
  jsOptions js;
  jsOptions_Init(&js);
  js.Wait = 1000;
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  while (true) {
    jsAccountInfo* info = nullptr;
    jsErrCode error{};
    const natsStatus s = js_GetAccountInfo(&info, jetstream_, &js, &error);
    jsAccountInfo_Destroy(info);
    const bool has_none = s == NATS_NO_RESPONDERS || error == JSNotEnabledErr || error == JSNotEnabledForAccountErr;
    if (!has_none) return;
    if (std::chrono::steady_clock::now() > until) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  throw InputError(options.url + ": the NATS server there has no JetStream: nats-server -a 127.0.0.1 -js -sd DIR");
}

Broker::~Broker() {
  acks_.reset();
  jsCtx_Destroy(jetstream_);
  natsConnection_Close(connection_);
  natsConnection_Destroy(connection_);
}

bool Broker::make_streams() {
  struct Made {
    const char *name, *subject;
    std::int64_t per_subject, age_ns;
  };
  constexpr std::int64_t week_ns = 7 * 86400 * second_ns;
  for (const Made& made : {Made{"ALIDADE_OBS", "cam.*.obs", -1, week_ns}, Made{"ALIDADE_STATE", "cam.*.state", 1, 0},
                           Made{"ALIDADE_ALARM", "cam.*.alarm", -1, 0}}) {
    if (extent(made.name)) continue;
    jsStreamConfig config;
    jsStreamConfig_Init(&config);
    config.Name = made.name;
    config.Subjects = const_cast<const char**>(&made.subject);
    config.SubjectsLen = 1;
    config.MaxMsgsPerSubject = made.per_subject;
    config.MaxAge = made.age_ns;
    jsStreamInfo* info = nullptr;
    jsErrCode error{};
    const natsStatus s = js_AddStream(&info, jetstream_, &config, nullptr, &error);
    jsStreamInfo_Destroy(info);
    if (s != NATS_OK && !extent(made.name)) return false;  // another may have made it meanwhile
  }
  return true;
}

KeyValues Broker::existing_bucket(const std::string& name) {
  kvStore* store = nullptr;
  return KeyValues(js_KeyValue(&store, jetstream_, name.c_str()) == NATS_OK ? store : nullptr);
}

KeyValues Broker::bucket(const std::string& name, double ttl_s) {
  if (KeyValues there = existing_bucket(name)) return there;
  kvStore* store = nullptr;
  kvConfig config;
  kvConfig_Init(&config);
  config.Bucket = name.c_str();
  config.History = 1;
  config.TTL = static_cast<std::int64_t>(ttl_s * static_cast<double>(second_ns));
  if (js_CreateKeyValue(&store, jetstream_, &config) != NATS_OK) return nullptr;
  return KeyValues(store);
}

Subscription Broker::read(const std::string& stream, const std::string& subject, std::uint64_t from) {
  jsSubOptions options;
  jsSubOptions_Init(&options);
  options.Stream = stream.c_str();
  options.Ordered = true;
  if (from > 1) {
    options.Config.DeliverPolicy = js_DeliverByStartSequence;
    options.Config.OptStartSeq = from;
  } else {
    options.Config.DeliverPolicy = js_DeliverAll;
  }
  natsSubscription* subscription = nullptr;
  jsErrCode error{};
  if (js_SubscribeSync(&subscription, jetstream_, subject.c_str(), nullptr, &options, &error) != NATS_OK)
    return nullptr;
  natsSubscription_SetPendingLimits(subscription, -1, -1);
  return Subscription(subscription);
}

Message Broker::next(const Subscription& from, int wait_ms, bool& is_lost) {
  natsMsg* message = nullptr;
  const natsStatus s = natsSubscription_NextMsg(&message, from.get(), wait_ms);
  if (s != NATS_OK && s != NATS_TIMEOUT) is_lost = true;
  return Message(s == NATS_OK ? message : nullptr);
}

Subscription Broker::listen(const std::string& subject) {
  natsSubscription* subscription = nullptr;
  if (natsConnection_SubscribeSync(&subscription, connection_, subject.c_str()) != NATS_OK) return nullptr;
  natsSubscription_SetPendingLimits(subscription, -1, -1);
  return Subscription(subscription);
}

std::optional<std::pair<std::uint64_t, std::uint64_t>> Broker::extent(const std::string& stream) {
  jsStreamInfo* info = nullptr;
  jsErrCode error{};
  if (js_GetStreamInfo(&info, jetstream_, stream.c_str(), nullptr, &error) != NATS_OK) return std::nullopt;
  const std::pair extent(info->State.Msgs, info->State.LastSeq);
  jsStreamInfo_Destroy(info);
  return extent;
}

bool Broker::store(std::vector<Publication>& messages, int wait_ms, const std::function<bool()>& goes_on) {
  const std::uint64_t round = ++num_stores_;
  std::size_t sent = 0, answered = 0;
  bool are_all = true;
  const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(wait_ms);
  while (answered < messages.size()) {
    for (; sent < messages.size() && sent - answered < window; ++sent) {
      Publication& each = messages[sent];
      natsMsg* message = nullptr;
      const std::string reply = fmt::format("{}.{}-{}", inbox_, round, sent);
      natsStatus s = natsMsg_Create(&message, each.subject.c_str(), reply.c_str(), each.payload.data(),
                                    static_cast<int>(each.payload.size()));
      for (const auto& [name, value] : each.headers)
        if (s == NATS_OK) s = natsMsgHeader_Set(message, name.c_str(), value.c_str());
      if (s == NATS_OK) s = natsConnection_PublishMsg(connection_, message);
      natsMsg_Destroy(message);
      if (s != NATS_OK) return false;
    }
    bool is_lost = false;
    const Message ack = next(acks_, 100, is_lost);
    if (std::chrono::steady_clock::now() > until || is_lost) return false;
    if (!ack && goes_on && !goes_on()) return false;
    if (!ack) continue;
    const std::string_view subject = natsMsg_GetSubject(ack.get());
    const std::string_view mark = subject.substr(subject.rfind('.') + 1);
    if (number_behind(mark, "") != round) continue;  // of a round that was given up
    const std::uint64_t index = number_behind(mark, "-").value_or(messages.size());
    if (index >= messages.size()) continue;
    ++answered;
    const std::string text(natsMsg_GetData(ack.get()), static_cast<std::size_t>(natsMsg_GetDataLength(ack.get())));
    const auto sequence = number_behind(text, "\"seq\":");
    messages[index].is_stored = text.find("\"error\"") == std::string::npos && sequence.value_or(0) > 0;
    messages[index].sequence = sequence.value_or(0);
    are_all = are_all && messages[index].is_stored;
  }
  return are_all;
}

std::optional<Place> place_of(const Message& message) {
  jsMsgMetaData* meta = nullptr;
  if (natsMsg_GetMetaData(&meta, message.get()) != NATS_OK) return std::nullopt;
  const Place place{meta->Sequence.Stream, meta->NumPending};
  jsMsgMetaData_Destroy(meta);
  return place;
}

std::string camera_of(const char* subject) {
  const std::string_view text(subject);
  const std::size_t first = text.find('.'), last = text.rfind('.');
  return first < last ? std::string(text.substr(first + 1, last - first - 1)) : std::string();
}

}  // namespace alidade::fleet
