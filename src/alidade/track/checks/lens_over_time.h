#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/pantilt/rig.h"

namespace alidade {

/// An observation not covered by its head's history of intrinsics: more than `beyond_s` outside its time span.
struct OutsideHistory {
  std::size_t head = 0;
  double t_s = 0.0;
};
[[nodiscard]] std::optional<OutsideHistory> outside_history(std::span<const TargetObservation> observations,
                                                            std::span<const IntrinsicsHistory> histories,
                                                            double beyond_s);

/// Gives each observation the intrinsics of its capture time, and the rig's lenses the corresponding errors: since the
/// errors of an observer are correlated in time, they are considered as constant errors of varying size. Heads without
/// a history keep their own.
void use_intrinsics_histories(std::span<const IntrinsicsHistory> histories,
                              std::vector<TargetObservation>& observations, Rig& rig);

}  // namespace alidade
