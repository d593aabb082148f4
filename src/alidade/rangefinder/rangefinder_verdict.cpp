#include "alidade/rangefinder/rangefinder.h"
namespace alidade {
Verdict rangefinder_verdict(const RangefinderReport&, std::span<const Shot>, const RangefinderConfig&) { return {}; }
}  // namespace alidade
