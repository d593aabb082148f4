#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <string>

#include "cli/fleet/broker.h"

namespace alidade::fleet {

/// Cameras are dealt into so many parts by their names, and parts to workers.
inline constexpr int num_parts = 32;
[[nodiscard]] int part_of(const std::string& camera);

/// The partitions of this worker: leases in a bucket whose keys expire after two seconds unless they are renewed. A
/// worker that stops renewing (is killed, or stalls) loses its partitions to the others, without a coordinator.
class Shares {
 public:
  explicit Shares(Broker& broker);

  /// Renews its leases, takes free partitions, returns those beyond a fair share. To be called often; acts every 0.4 s.
  /// Whether its partitions have changed.
  [[nodiscard]] bool keep();
  [[nodiscard]] bool holds(int part) const { return revision_[static_cast<std::size_t>(part)] > 0; }
  [[nodiscard]] int num_held() const;
  /// Of a worker that ends.
  void give_back();

 private:
  bool renew();
  bool take_and_give(int fair);
  [[nodiscard]] int num_workers();

  Broker& broker_;
  KeyValues leases_;
  std::string id_;
  std::uint64_t own_revision_ = 0;
  std::array<std::uint64_t, num_parts> revision_{};  ///< Of the lease; 0: none.
  std::chrono::steady_clock::time_point next_ = {};
};

}  // namespace alidade::fleet
