#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/pantilt/rig.h"

namespace alidade {

/// An observation of which a head's history of intrinsics says nothing: more than `beyond_s` outside what it spans.
struct OutsideHistory {
  std::size_t head = 0;
  double t_s = 0.0;
};
[[nodiscard]] std::optional<OutsideHistory> outside_history(std::span<const TargetObservation> observations,
                                                            std::span<const IntrinsicsHistory> histories,
                                                            double beyond_s);

/// Gives each observation the intrinsics of its capture, and the rig's lenses the errors that these have: as an
/// observer's errors last, they are considered as persistent errors that change in size only. Heads without a history
/// keep their own.
void use_intrinsics_histories(std::span<const IntrinsicsHistory> histories,
                              std::vector<TargetObservation>& observations, Rig& rig);

}  // namespace alidade
