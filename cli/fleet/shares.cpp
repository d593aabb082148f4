#include "cli/fleet/shares.h"

#include <unistd.h>

#include <algorithm>
#include <random>
#include <string_view>

namespace alidade::fleet {
namespace {

constexpr double lease_s = 2.0;
constexpr auto keep_every = std::chrono::milliseconds(400);
constexpr const char* bucket_name = "ALIDADE_LEASE";
constexpr std::string_view mark = "member.", mark_of_earlier = "worker.";

std::string part_key(int part) { return "part." + std::to_string(part); }

}  // namespace

Shares::Shares(Broker& broker) : broker_(broker) {
  std::random_device device;
  id_ = std::string(mark) + std::to_string(::getpid()) + "-" + std::to_string(device());
}

int Shares::num_held() const {
  return static_cast<int>(std::ranges::count_if(revision_, [](std::uint64_t revision) { return revision > 0; }));
}

bool Shares::keep() {
  if (std::chrono::steady_clock::now() < next_) return false;
  next_ = std::chrono::steady_clock::now() + keep_every;
  if (!leases_) leases_ = broker_.bucket(bucket_name, lease_s);
  if (!leases_) return false;
  const bool has_lost = renew();
  const int workers = num_workers();
  return take_and_give((num_fleet_parts + workers - 1) / std::max(workers, 1)) || has_lost;
}

/// Its own mark, and its partitions; whether any of them now belongs to another.
bool Shares::renew() {
  const auto length = static_cast<int>(id_.size());
  if (kvStore_Put(&own_revision_, leases_.get(), id_.c_str(), id_.data(), length) != NATS_OK) leases_.reset();
  bool has_lost = false;
  for (int part = 0; part < num_fleet_parts && leases_; ++part) {
    std::uint64_t& revision = revision_[static_cast<std::size_t>(part)];
    if (revision == 0) continue;
    const natsStatus s = kvStore_Update(&revision, leases_.get(), part_key(part).c_str(), id_.data(), length, revision);
    if (s == NATS_OK) continue;
    revision = 0;
    has_lost = true;
  }
  if (leases_) return has_lost;
  // The broker is not there: nothing is certain until it is.
  const bool had_any = num_held() > 0;
  revision_.fill(0);
  return had_any;
}

int Shares::num_workers() {
  kvKeysList keys{};
  num_earlier_ = 0;
  if (!leases_ || kvStore_Keys(&keys, leases_.get(), nullptr) != NATS_OK) return 1;
  int count = 0;
  for (int i = 0; i < keys.Count; ++i) {
    const std::string_view key = keys.Keys[i];
    count += key.starts_with(mark) ? 1 : 0;
    num_earlier_ += key.starts_with(mark_of_earlier) ? 1 : 0;
  }
  kvKeysList_Destroy(&keys);
  return std::max(count, 1);
}

bool Shares::take(int part) {
  std::uint64_t& revision = revision_[static_cast<std::size_t>(part)];
  const auto length = static_cast<int>(id_.size());
  if (kvStore_Create(&revision, leases_.get(), part_key(part).c_str(), id_.data(), length) == NATS_OK) return true;
  revision = 0;
  return num_earlier_ > 0 && take_over(part);
}

bool Shares::take_over(int part) {
  kvEntry* entry = nullptr;
  if (kvStore_Get(&entry, leases_.get(), part_key(part).c_str()) != NATS_OK) return false;
  const char* text = kvEntry_ValueString(entry);
  const bool is_earlier = text != nullptr && std::string_view(text).starts_with(mark_of_earlier);
  const std::uint64_t last = kvEntry_Revision(entry);
  kvEntry_Destroy(entry);
  std::uint64_t& revision = revision_[static_cast<std::size_t>(part)];
  const auto length = static_cast<int>(id_.size());
  if (is_earlier &&
      kvStore_Update(&revision, leases_.get(), part_key(part).c_str(), id_.data(), length, last) == NATS_OK)
    return true;
  revision = 0;
  return false;
}

bool Shares::take_and_give(int fair) {
  bool has_changed = false;
  int held = num_held();
  for (int part = num_fleet_parts - 1; part >= 0 && leases_ && held > fair; --part) {
    std::uint64_t& revision = revision_[static_cast<std::size_t>(part)];
    if (revision == 0) continue;
    kvStore_Delete(leases_.get(), part_key(part).c_str());
    revision = 0;
    --held;
    has_changed = true;
  }
  for (int part = 0; part < num_fleet_parts && leases_ && held < fair; ++part) {
    if (holds(part) || !take(part)) continue;
    ++held;
    has_changed = true;
  }
  return has_changed;
}

void Shares::give_back() {
  for (int part = 0; part < num_fleet_parts && leases_; ++part)
    if (holds(part)) kvStore_Delete(leases_.get(), part_key(part).c_str());
  if (leases_) kvStore_Delete(leases_.get(), id_.c_str());
  revision_.fill(0);
}

}  // namespace alidade::fleet
