#include "cli/fleet/worker.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <thread>
#include <unordered_map>
#include <utility>

#include "alidade/fleet/row_order.h"
#include "alidade/results/fleet_text.h"
#include "cli/app/terminal.h"
#include "cli/fleet/shares.h"

namespace alidade::fleet {
namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* position_bucket = "ALIDADE_READ";
constexpr const char* earlier_position_bucket = "ALIDADE_POSITION";  // of releases that dealt the cameras otherwise
constexpr const char* checkpoint_header = "Alidade-Checkpoint";
constexpr const char* expected_header = "Nats-Expected-Last-Subject-Sequence";
constexpr const char* numbers_header = "Alidade-Numbers";
constexpr std::size_t most_told = 20;  // of each kind of fault of the rows
constexpr int store_ms = 10000;        // for the broker to store what was done
constexpr double min_flush_s = 1.0;    // between checkpoints
constexpr std::size_t states_at_once = 500;
constexpr std::size_t max_rows = 50000;  // between checkpoints

/// A camera as this worker has it.
struct Held {
  FleetCamera camera;
  FleetRowOrder order;
  std::uint64_t state_sequence = 0;  ///< Of its state in the stream; 0: none.
  bool is_dirty = false;
};

std::string_view payload_of(const Message& message) {
  return {natsMsg_GetData(message.get()), static_cast<std::size_t>(natsMsg_GetDataLength(message.get()))};
}

/// Reads the whole stream of observations and takes up the cameras of its parts. What it has in memory it could have
/// read: after any failure it discards everything, and resumes from the stored states.
class Worker {
 public:
  Worker(const cli::FleetWorkerOptions& options, cli::Run& run)
      : options_(options), run_(run), broker_(broker_options(options.broker)), shares_(broker_) {}

  ExitCode work() {
    tell(fmt::format("worker: {}, stop with Ctrl-C", options_.broker.url));
    while (goes_on()) {
      if (!broker_.is_connected() || !broker_.make_streams()) {
        say_absent();
        rest();
        continue;
      }
      absent_since_ = Clock::time_point::max();
      const bool has_changed = shares_.keep();
      if (shares_.num_earlier() > 0 && !std::exchange(has_said_earlier_, true))
        tell("a worker of an earlier release is at this broker: it is left without cameras, and may be stopped");
      if (shares_.num_held() == 0) {
        rest();
        continue;
      }
      if (has_changed || !is_reading_) {
        if (is_reading_) (void)flush();
        if (!begin()) {
          rest();
          continue;
        }
      }
      read_some();
    }
    if (broker_.is_connected()) {
      if (is_reading_) (void)flush();
      shares_.give_back();
    }
    tell(closing_line());
    return ExitCode::ok;  // a stop request is how a worker ends
  }

 private:
  [[nodiscard]] bool goes_on() const { return !run_.progress || run_.progress("rows", num_rows_, 0); }
  static void rest() { std::this_thread::sleep_for(std::chrono::milliseconds(50)); }
  /// Once, where the broker or its streams have not been there for some seconds.
  void say_absent() {
    constexpr auto patience = std::chrono::seconds(5);
    if (absent_since_ == Clock::time_point::max()) absent_since_ = Clock::now();
    if (has_said_absent_ || Clock::now() - absent_since_ < patience) return;
    has_said_absent_ = true;
    tell(fmt::format(
        "{}: {}", options_.broker.url,
        broker_.is_connected() ? "its streams cannot be made or read; waiting for them" : "is away; waiting for it"));
  }
  void tell(const std::string& line) const {
    if (!run_.options.quiet) cli::tell_person(line);
  }

  /// A line of a kind of which there may be many.
  void tell_some(std::size_t& told, const std::string& line) const {
    if (++told <= most_told) tell(line + (told == most_told ? "; further ones are only counted" : ""));
  }

  /// How many rows were taken in, and what became of the others.
  [[nodiscard]] std::string closing_line() const {
    std::size_t waiting = 0;
    std::string first_waiting, text;
    for (const auto& [id, held] : cameras_) {
      if (held.order.num_waiting() == 0) continue;
      waiting += held.order.num_waiting();
      if (first_waiting.empty()) first_waiting = fmt::format("{}: for {}", id, held.order.n() + 1);
    }
    const auto add = [&text](std::size_t count, const std::string& what) {
      if (count > 0) text += fmt::format("{} {} {}", text.empty() ? ":" : ";", count, what);
    };
    add(waiting, fmt::format("wait for one before them ({})", first_waiting));
    add(num_late_, "came again, or too late");
    add(num_faults_, "are no rows");
    add(num_missing_, "never came");
    add(num_restarts_, num_restarts_ == 1 ? "restart of an observer" : "restarts of observers");
    const std::size_t others = waiting + num_late_ + num_faults_;
    const std::string of = others > 0 ? fmt::format(" of {}", num_rows_ + others) : "";
    return fmt::format("{}{} rows of {} cameras taken in", num_rows_, of, cameras_.size()) + text;
  }

  /// States of its cameras, and the position from which observations are to be read. False: not now.
  bool begin() {
    is_reading_ = false;
    observations_.reset();
    cameras_.clear();
    alarms_.clear();
    reconnects_ = broker_.num_reconnects();
    if (!positions_) positions_ = broker_.bucket(position_bucket, 0.0);
    const auto extent = broker_.extent("ALIDADE_OBS");
    if (!positions_ || !extent || !load_states(extent->second)) return false;
    std::uint64_t from = ~std::uint64_t{0};
    for (int part = 0; part < num_fleet_parts; ++part) {
      bool& is_read = is_read_[static_cast<std::size_t>(part)];
      is_read = shares_.holds(part);
      if (is_read) from = std::min(from, position_of(part));
    }
    observations_ = broker_.read("ALIDADE_OBS", "cam.*.obs", from + 1);
    position_ = from;
    is_reading_ = observations_ != nullptr;
    last_flush_ = Clock::now();
    return is_reading_;
  }

  bool load_states(std::uint64_t last_observation) {
    const auto extent = broker_.extent("ALIDADE_STATE");
    if (!extent) return false;
    if (extent->first == 0) return true;
    const Subscription states = broker_.read("ALIDADE_STATE", "cam.*.state", 1);
    if (!states) return false;
    bool is_lost = false;
    while (!is_lost && goes_on()) {
      const Message message = Broker::next(states, 2000, is_lost);
      const auto place = message ? place_of(message) : std::nullopt;
      if (!place) return false;
      load_state(message, place->sequence, last_observation);
      if (place->pending == 0) return true;
    }
    return false;
  }

  void load_state(const Message& message, std::uint64_t sequence, std::uint64_t last_observation) {
    const std::string id = camera_of(natsMsg_GetSubject(message.get()));
    if (!shares_.holds(fleet_part_of(id))) return;
    Held held;
    held.state_sequence = sequence;
    const char* text = nullptr;
    // A state without a checkpoint that can be read: the camera is reinitialised with the rows after it.
    held.camera.n = fleet_state_n(payload_of(message));
    if (natsMsgHeader_Get(message.get(), checkpoint_header, &text) == NATS_OK && text != nullptr)
      if (const auto camera = parse_checkpoint(text)) held.camera = *camera;
    FleetNumbers numbers;
    if (natsMsgHeader_Get(message.get(), numbers_header, &text) != NATS_OK || !parse_numbers(text, numbers)) {
      numbers.read_to = last_observation;  // of a release that kept no numbers
      if (held.camera.has_row != 0) numbers.last_t_s = held.camera.t_s;
    }
    held.order = FleetRowOrder(numbers, held.camera.n);
    cameras_[id] = std::move(held);
  }

  /// Up to there all observations of a part are in the states.
  std::uint64_t position_of(int part) {
    if (const auto position = position_in(positions_, part)) return *position;
    // Never written: not before the least of an earlier release's, where that has all of them.
    const KeyValues earlier = broker_.existing_bucket(earlier_position_bucket);
    std::uint64_t least = ~std::uint64_t{0};
    for (int each = 0; earlier && each < num_fleet_parts; ++each)
      least = std::min(least, position_in(earlier, each).value_or(0));
    return earlier ? least : 0;
  }

  static std::optional<std::uint64_t> position_in(const KeyValues& bucket, int part) {
    kvEntry* entry = nullptr;
    if (kvStore_Get(&entry, bucket.get(), std::to_string(part).c_str()) != NATS_OK) return std::nullopt;
    const char* text = kvEntry_ValueString(entry);
    const std::uint64_t position = text != nullptr ? std::strtoull(text, nullptr, 10) : 0;
    kvEntry_Destroy(entry);
    return position;
  }

  void read_some() {
    bool is_lost = broker_.num_reconnects() != reconnects_;
    const auto until = Clock::now() + std::chrono::milliseconds(100);
    while (!is_lost && Clock::now() < until && since_flush_ < max_rows) {
      const Message message = Broker::next(observations_, 20, is_lost);
      if (!message) {
        if (Clock::now() - last_message_ > std::chrono::seconds(5)) is_lost = is_lost || is_behind();
        break;
      }
      last_message_ = Clock::now();
      take(message);
    }
    const std::chrono::duration<double> since = Clock::now() - last_flush_;
    const bool is_due = since.count() > std::max(min_flush_s, 3.0 * flush_s_) || since_flush_ >= max_rows;
    if (!is_lost && since_flush_ > 0 && is_due) is_lost = !flush();
    if (is_lost) is_reading_ = false;
  }

  /// Nothing comes: is there nothing?
  bool is_behind() {
    last_message_ = Clock::now();
    const auto extent = broker_.extent("ALIDADE_OBS");
    return !extent || extent->second > position_;
  }

  void take(const Message& message) {
    const auto place = place_of(message);
    if (!place) return;
    position_ = std::max(position_, place->sequence);
    ++since_flush_;
    const std::string id = camera_of(natsMsg_GetSubject(message.get()));
    if (id.empty() || !is_read_[static_cast<std::size_t>(fleet_part_of(id))]) return;
    std::string fault;
    const auto row = parse_fleet_row(payload_of(message), fault);
    if (!row) return tell_some(num_faults_, fmt::format("cam.{}.obs: {}", id, fault));
    Held& held = cameras_[id];
    ready_.clear();
    const auto arrival = held.order.add(*row, place->sequence, ready_);
    if (arrival == FleetRowOrder::Arrival::late)
      tell_some(num_late_, fmt::format("cam.{}.obs: row {} came again, or too late: it is rejected", id, row->n));
    if (arrival == FleetRowOrder::Arrival::waits && held.order.num_waiting() == 3) say_waits(id, held);
    for (const FleetRowOrder::Ready& each : ready_) {
      say_order(id, each);
      take_in(id, held, each.row);
    }
  }

  /// A few rows wait: for which? A camera without a state gets one that says so.
  void say_waits(const std::string& id, Held& held) {
    held.is_dirty = held.is_dirty || held.order.n() == 0;
    tell_some(num_waits_, fmt::format("cam.{}.obs: row {} has not come; those from {} on wait for it, half a minute or "
                                      "256 rows at most",
                                      id, held.order.n() + 1, held.order.first_waiting_n()));
  }

  void say_order(const std::string& id, const FleetRowOrder::Ready& ready) {
    const std::int64_t n = ready.row.n;
    if (ready.begins_anew) tell_some(num_restarts_, fmt::format("cam.{}.obs: the observer restarted: row {}", id, n));
    if (ready.num_missing == 0) return;
    num_missing_ += static_cast<std::size_t>(ready.num_missing);
    tell_some(num_gaps_, fmt::format("cam.{}.obs: {} before row {} never came, and {} given up", id,
                                     ready.num_missing == 1 ? "one row" : fmt::format("{} rows", ready.num_missing), n,
                                     ready.num_missing == 1 ? "is" : "are"));
  }

  void take_in(const std::string& id, Held& held, const FleetRow& row) {
    const auto alarm = advance(held.camera, row, options_.config);
    held.is_dirty = true;
    ++num_rows_;
    if (!alarm) return;
    Publication& publication = alarms_.emplace_back();
    publication.subject = "cam." + id + ".alarm";
    publication.payload = fleet_alarm_text(id, *alarm);
    const std::int64_t restarts = held.order.numbers().num_restarts;
    publication.headers["Nats-Msg-Id"] = fmt::format("{}-{}-{}{}", id, alarm->n, kind_name(alarm->kind),
                                                     restarts > 0 ? fmt::format("-{}", restarts) : "");
  }

  /// Alarms, then states with their checkpoints, then how far it has read. False: the broker has not stored all of it,
  /// or another worker has written the state of one of its cameras.
  bool flush() {
    const auto begin = Clock::now();
    if (!alarms_.empty() && !broker_.store(alarms_, store_ms)) return false;
    alarms_.clear();
    std::vector<Publication> states;
    std::vector<Held*> whose;
    for (auto& [id, held] : cameras_) {
      if (!held.is_dirty) continue;
      whose.push_back(&held);
      Publication& state = states.emplace_back();
      state.subject = "cam." + id + ".state";
      state.payload = fleet_state_text(id, held.camera, held.order.numbers());
      state.headers[numbers_header] = numbers_text(held.order.numbers());
      state.headers[checkpoint_header] = checkpoint_text(held.camera);
      state.headers[expected_header] = std::to_string(held.state_sequence);
      if (states.size() == states_at_once && !store_states(states, whose)) return false;
    }
    if (!store_states(states, whose)) return false;
    const std::string position = std::to_string(safe_position());
    for (int part = 0; part < num_fleet_parts; ++part) {
      // Of a part that has just come nothing has been read yet.
      if (!shares_.holds(part) || !is_read_[static_cast<std::size_t>(part)]) continue;
      std::uint64_t revision = 0;
      if (kvStore_PutString(&revision, positions_.get(), std::to_string(part).c_str(), position.c_str()) != NATS_OK)
        return false;
    }
    since_flush_ = 0;
    last_flush_ = Clock::now();
    flush_s_ = std::chrono::duration<double>(last_flush_ - begin).count();
    return true;
  }

  bool store_states(std::vector<Publication>& states, std::vector<Held*>& whose) {
    if (!states.empty() && !broker_.store(states, store_ms)) return false;
    for (std::size_t i = 0; i < states.size(); ++i) {
      whose[i]->is_dirty = false;
      whose[i]->state_sequence = states[i].sequence;
    }
    states.clear();
    whose.clear();
    return true;
  }

  /// All observations up to there are in the states: those that wait for earlier ones are not.
  [[nodiscard]] std::uint64_t safe_position() const {
    std::uint64_t position = position_;
    for (const auto& [id, held] : cameras_)
      if (held.order.num_waiting() > 0) position = std::min(position, held.order.first_waiting_place() - 1);
    return position;
  }

  const cli::FleetWorkerOptions& options_;
  cli::Run& run_;
  Broker broker_;
  Shares shares_;
  KeyValues positions_;
  Subscription observations_;
  std::unordered_map<std::string, Held> cameras_;
  std::vector<Publication> alarms_;
  std::uint64_t position_ = 0;
  std::vector<FleetRowOrder::Ready> ready_;
  std::size_t num_rows_ = 0, since_flush_ = 0;
  std::size_t num_faults_ = 0, num_late_ = 0, num_waits_ = 0, num_gaps_ = 0, num_missing_ = 0, num_restarts_ = 0;
  double flush_s_ = 0.0;
  std::array<bool, num_fleet_parts> is_read_{};  ///< Parts whose states were loaded, and whose rows are taken in.
  int reconnects_ = 0;
  bool is_reading_ = false, has_said_earlier_ = false, has_said_absent_ = false;
  Clock::time_point absent_since_ = Clock::time_point::max();
  Clock::time_point last_flush_ = Clock::now(), last_message_ = Clock::now();
};

}  // namespace

BrokerOptions broker_options(const cli::FleetBroker& broker) {
  return {broker.url, broker.credentials, broker.ca, broker.certificate, broker.key};
}

ExitCode run_worker(const cli::FleetWorkerOptions& options, cli::Run& run) { return Worker(options, run).work(); }

}  // namespace alidade::fleet
