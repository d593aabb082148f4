#pragma once

#include "alidade/observe/observe.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// Fills counts, estimate, stddev, covariance and data of the document of `alidade observe`; also for a refusal.
void fill_observation(const RotationLog& log, const ObserveReport& report, const Camera& camera,
                      ResultDocument& document);

/// One row of `steps`. `truth`: null where it is not known.
[[nodiscard]] DataTable observe_row(double t_s, const IntrinsicsEstimate& estimate, const RotationFrame& frame,
                                    const TrueIntrinsics* truth);

}  // namespace alidade
