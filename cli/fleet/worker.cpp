#include "cli/fleet/worker.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <map>
#include <thread>
#include <unordered_map>
#include <utility>

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
constexpr std::size_t max_held = 256;  // rows of a camera that wait for one before them; then that one is given up
constexpr int store_ms = 10000;        // for the broker to store what was done
constexpr double min_flush_s = 1.0;    // between checkpoints
constexpr std::size_t states_at_once = 500;
constexpr std::size_t max_rows = 50000;  // between checkpoints

/// A camera as this worker has it.
struct Held {
  FleetCamera camera;
  std::uint64_t state_sequence = 0;  ///< Of its state in the stream; 0: none.
  bool is_dirty = false;
  std::map<std::int64_t, std::pair<FleetRow, std::uint64_t>> early;  ///< By n, with their position in the stream.
};

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
        rest();
        continue;
      }
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
    if (is_reading_) (void)flush();
    shares_.give_back();
    tell(fmt::format("{} rows of {} cameras taken in", num_rows_, cameras_.size()));
    return ExitCode::ok;  // a stop request is how a worker ends
  }

 private:
  [[nodiscard]] bool goes_on() const { return !run_.progress || run_.progress("rows", num_rows_, 0); }
  static void rest() { std::this_thread::sleep_for(std::chrono::milliseconds(50)); }
  void tell(const std::string& line) const {
    if (!run_.options.quiet) cli::tell_person(line);
  }

  /// States of its cameras, and the position from which observations are to be read. False: not now.
  bool begin() {
    is_reading_ = false;
    observations_.reset();
    cameras_.clear();
    alarms_.clear();
    num_early_ = 0;
    reconnects_ = broker_.num_reconnects();
    if (!positions_) positions_ = broker_.bucket(position_bucket, 0.0);
    if (!positions_ || !load_states()) return false;
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

  bool load_states() {
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
      load_state(message, place->sequence);
      if (place->pending == 0) return true;
    }
    return false;
  }

  void load_state(const Message& message, std::uint64_t sequence) {
    const std::string id = camera_of(natsMsg_GetSubject(message.get()));
    if (!shares_.holds(fleet_part_of(id))) return;
    Held held;
    held.state_sequence = sequence;
    const char* text = nullptr;
    // A state without a checkpoint that can be read: the camera is reinitialised with the available rows.
    if (natsMsgHeader_Get(message.get(), checkpoint_header, &text) == NATS_OK && text != nullptr)
      if (const auto camera = parse_checkpoint(text)) held.camera = *camera;
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
    const std::string_view payload(natsMsg_GetData(message.get()),
                                   static_cast<std::size_t>(natsMsg_GetDataLength(message.get())));
    const auto row = parse_fleet_row(payload, fault);
    if (!row) {
      if (num_faults_++ < 10) tell(fmt::format("cam.{}.obs: {}", id, fault));
      return;
    }
    Held& held = cameras_[id];
    if (row->n <= held.camera.n) return;  // taken in before
    if (row->n > held.camera.n + 1) {
      num_early_ += held.early.emplace(row->n, std::pair(*row, place->sequence)).second ? 1 : 0;
      if (held.early.size() <= max_held) return;
    } else {
      take_in(id, held, *row);
    }
    while (!held.early.empty()) {
      const auto first = held.early.begin();
      const bool is_next = first->first == held.camera.n + 1;
      if (!is_next && held.early.size() <= max_held) break;
      take_in(id, held, first->second.first);
      held.early.erase(first);
      --num_early_;
    }
  }

  void take_in(const std::string& id, Held& held, const FleetRow& row) {
    const auto alarm = advance(held.camera, row, options_.config);
    held.is_dirty = true;
    ++num_rows_;
    if (!alarm) return;
    Publication& publication = alarms_.emplace_back();
    publication.subject = "cam." + id + ".alarm";
    publication.payload = fleet_alarm_text(id, *alarm);
    publication.headers["Nats-Msg-Id"] = fmt::format("{}-{}-{}", id, alarm->n, kind_name(alarm->kind));
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
      state.payload = fleet_state_text(id, held.camera);
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
    if (num_early_ == 0) return position;
    for (const auto& [id, held] : cameras_)
      for (const auto& [n, early] : held.early) position = std::min(position, early.second - 1);
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
  std::size_t num_rows_ = 0, num_faults_ = 0, num_early_ = 0, since_flush_ = 0;
  double flush_s_ = 0.0;
  std::array<bool, num_fleet_parts> is_read_{};  ///< Parts whose states were loaded, and whose rows are taken in.
  int reconnects_ = 0;
  bool is_reading_ = false, has_said_earlier_ = false;
  Clock::time_point last_flush_ = Clock::now(), last_message_ = Clock::now();
};

}  // namespace

BrokerOptions broker_options(const cli::FleetBroker& broker) {
  return {broker.url, broker.credentials, broker.ca, broker.certificate, broker.key};
}

ExitCode run_worker(const cli::FleetWorkerOptions& options, cli::Run& run) { return Worker(options, run).work(); }

}  // namespace alidade::fleet
