#pragma once

#include <span>

#include "alidade/results/result_document.h"
#include "alidade/servo/identify.h"

namespace alidade {

/// Fills counts, estimate, stddev, covariance and the table `response` of the document of `alidade identify`; also for
/// a refusal.
void fill_identification(std::span<const ServoSample> log, const ServoIdentification& identified,
                         ResultDocument& document);

}  // namespace alidade
