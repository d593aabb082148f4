#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <string>

#include "alidade/fleet/fleet_parts.h"
#include "cli/fleet/broker.h"

namespace alidade::fleet {

/// The partitions of this worker: leases in a bucket whose keys expire after two seconds unless they are renewed. A
/// worker that stops renewing (is killed, or stalls) loses its partitions to the others, without a coordinator.
/// Workers of earlier releases deal the cameras otherwise: whatever partition one of them holds is taken from it.
class Shares {
 public:
  explicit Shares(Broker& broker);

  /// Renews its leases, takes free partitions, returns those beyond a fair share. To be called often; acts every 0.4 s.
  /// Whether its partitions have changed.
  [[nodiscard]] bool keep();
  [[nodiscard]] bool holds(int part) const { return revision_[static_cast<std::size_t>(part)] > 0; }
  [[nodiscard]] int num_held() const;
  /// Workers of an earlier release at this broker, by their marks.
  [[nodiscard]] int num_earlier() const { return num_earlier_; }
  /// Of a worker that ends.
  void give_back();

 private:
  bool renew();
  bool take_and_give(int fair);
  [[nodiscard]] int num_workers();
  /// A lease that is free, or of an earlier release's worker.
  [[nodiscard]] bool take(int part);
  [[nodiscard]] bool take_over(int part);

  Broker& broker_;
  KeyValues leases_;
  std::string id_;
  std::uint64_t own_revision_ = 0;
  int num_earlier_ = 0;
  std::array<std::uint64_t, num_fleet_parts> revision_{};  ///< Of the lease; 0: none.
  std::chrono::steady_clock::time_point next_ = {};
};

}  // namespace alidade::fleet
