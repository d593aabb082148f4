#include "alidade/live/topic_store.h"

#include <fmt/format.h>

#include <algorithm>

namespace alidade::live {
namespace {

constexpr std::size_t max_waiting_bytes = 4'000'000;
constexpr std::size_t max_subscriptions = 256;
constexpr double kept_s = 60.0;
constexpr double between_notes_s = 2.0;  // or notes fill the queue themselves
constexpr std::uint32_t replaces_time = 0xffffffffU, replaces_note = 0xfffffffeU, replaces_warning = 0xfffffffdU;

Outgoing text_message(std::string text, std::uint32_t replaces = 0) {
  return {MessageKind::control, true, std::move(text), nullptr, replaces};
}

}  // namespace

TopicStore::TopicStore(const std::vector<Topic>& topics) {
  for (const Topic& topic : topics) {
    State& made = *topics_.emplace_back(std::make_unique<State>());
    made.topic = topic;
    const std::size_t lanes = std::max<std::size_t>(1, topic.lanes);
    made.limits.assign(lanes, RateLimit(topic.max_hz / static_cast<double>(lanes)));
  }
}

std::size_t TopicStore::index_of(std::string_view name) const {
  for (std::size_t i = 0; i < topics_.size(); ++i)
    if (topics_[i]->topic.channel.topic == name) return i;
  return none;
}

bool TopicStore::lets_through(std::size_t index, std::size_t lane, double now_s) {
  State& topic = *topics_[index];
  const std::scoped_lock lock(topic.mutex);
  return topic.limits[lane % topic.limits.size()].lets_through(now_s);
}

MessageKind TopicStore::kind_of(std::size_t index) const {
  const TopicKind kind = topics_[index]->topic.kind;
  return kind == TopicKind::images  ? MessageKind::image
         : kind == TopicKind::steps ? MessageKind::step
                                    : MessageKind::control;
}

std::vector<Channel> TopicStore::channels() const {
  std::vector<Channel> channels;
  for (const auto& topic : topics_) channels.push_back(topic->topic.channel);
  return channels;
}

void TopicStore::keep(std::size_t index, KeptMessage message) {
  State& topic = *topics_[index];
  if (topic.topic.kind != TopicKind::steps) topic.kept.clear();
  while (!topic.kept.empty() && message.at_s - topic.kept.front().at_s > kept_s) topic.kept.pop_front();
  topic.kept.push_back(std::move(message));
}

Feed::Feed(const TopicStore& topics, std::string_view session_id) : topics_(topics), queue_(max_waiting_bytes) {
  queue_.push(text_message(server_info_text("alidade", session_id)));
  queue_.push(text_message(advertise_text(topics.channels())));
}

void Feed::hear(std::string_view text) {
  const ClientRequest request = client_request(text);
  if (!request.fault.empty()) warn(request.fault);
  for (const auto& [subscription, channel] : request.subscribe) subscribe(subscription, channel);
  for (const std::uint32_t subscription : request.unsubscribe) {
    const auto gone = std::erase_if(subscriptions_, [&](const auto& s) { return s.first == subscription; });
    if (gone == 0) warn(fmt::format("there is no subscription {}", subscription));
  }
}

void Feed::warn(std::string_view what) {
  queue_.push(text_message(status_text(StatusLevel::warning, what), replaces_warning));
}

void Feed::offer(std::size_t index, const KeptMessage& message) {
  for (const auto& [subscription, topic] : subscriptions_)
    if (topic == index) push(subscription, index, message);
}

void Feed::tell(StatusLevel level, std::string_view message) { queue_.push(text_message(status_text(level, message))); }

void Feed::tell_time(std::uint64_t t_ns) {
  queue_.push({MessageKind::control, false, time_bytes(t_ns), nullptr, replaces_time});
}

void Feed::note_dropped(double now_s) {
  if (!queue_.has_dropped() || now_s - noted_at_s_ < between_notes_s) return;
  noted_at_s_ = now_s;
  const SendQueue::Dropped dropped = queue_.take_dropped();
  queue_.push(text_message(
      status_text(StatusLevel::warning, fmt::format("dropped {} images and {} steps: this client reads too slowly",
                                                    dropped.images, dropped.steps)),
      replaces_note));
}

bool Feed::subscribes_to(std::size_t index) const {
  return std::ranges::any_of(subscriptions_, [index](const auto& s) { return s.second == index; });
}

void Feed::subscribe(std::uint32_t subscription, std::uint64_t channel) {
  if (channel < 1 || channel > topics_.size()) return warn(fmt::format("there is no channel {}", channel));
  if (std::ranges::any_of(subscriptions_, [&](const auto& s) { return s.first == subscription; }))
    return warn(fmt::format("subscription {} is there already", subscription));
  if (subscriptions_.size() >= max_subscriptions) return warn("too many subscriptions");
  const auto index = static_cast<std::size_t>(channel - 1);
  subscriptions_.emplace_back(subscription, index);
  for (const KeptMessage& message : topics_.kept(index)) push(subscription, index, message);
}

void Feed::push(std::uint32_t subscription, std::size_t index, const KeptMessage& message) {
  const MessageKind kind = topics_.kind_of(index);
  const std::uint32_t replaces = kind == MessageKind::control ? subscription % replaces_warning + 1 : 0;
  queue_.push({kind, false, message_head(subscription, message.t_ns), message.body, replaces});
}

}  // namespace alidade::live
