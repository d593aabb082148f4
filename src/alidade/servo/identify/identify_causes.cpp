#include "alidade/servo/identify/identify_causes.h"

#include <algorithm>
#include <cmath>

#include "alidade/servo/identify/identify_flaws.h"

namespace alidade {

std::vector<ServoCause> servo_causes(std::span<const ServoSample> log, const ServoIdentification& identified) {
  constexpr double sigmas_of_a_cause = 4.0;  // for a correct model, the largest of thirty is below it in 99.8 %
  const ServoFit& fit = identified.fit;
  std::vector<ServoCause> causes;
  if (!fit.is_observable || identified.residual_rad.empty()) return causes;
  const FlawGround ground = flaw_ground(log, fit);
  const double dof =
      static_cast<double>(ground.misfit.size()) - num_servo_params - static_cast<double>(fit.freed.size()) - 1.0;
  const double sum2 = ground.misfit.squaredNorm();
  std::vector<ServoFlaws> others;
  for (std::size_t flaw = 0; flaw < ServoFlaw::resonance; ++flaw) {
    if (std::ranges::count(fit.freed, flaw) > 0) continue;
    const FlawScore best = flaw_scores(log, fit, ground, flaw).front();
    const double sigmas = std::sqrt(best.gain2 * dof / std::max(sum2 - best.gain2, 1e-6 * sum2));
    if (!(sigmas > sigmas_of_a_cause)) continue;
    causes.push_back({servo_flaw_words[flaw], best.size, servo_flaw_units[flaw], sigmas});
    others.push_back(fit.flaws);
    others.back().*servo_flaws[flaw] = best.size;
  }
  constexpr std::size_t several = 2;
  if (std::ranges::count(fit.freed, std::size_t{ServoFlaw::resonance}) == 0 && num_sizes(log, several) >= several) {
    const ResonanceScore best = resonance_score(log, fit, ground, others);
    if (best.sigmas > sigmas_of_a_resonance)
      causes.push_back(
          {servo_flaw_words[ServoFlaw::resonance], best.hz, servo_flaw_units[ServoFlaw::resonance], best.sigmas});
  }
  std::ranges::sort(causes, std::greater{}, &ServoCause::sigmas);
  return causes;
}

std::size_t num_sizes(std::span<const ServoSample> log, std::size_t most) {
  constexpr double apart = 0.1;
  std::vector<double> sizes;
  for (const ServoSample& row : log) {
    const double size = std::abs(row.command);
    const bool is_known =
        std::ranges::any_of(sizes, [&](double known) { return std::abs(size - known) <= apart * known; });
    if (size > 0.0 && !is_known) sizes.push_back(size);
    if (sizes.size() >= most) break;
  }
  return sizes.size();
}

double encoder_step_rad(std::span<const ServoSample> log) {
  std::vector<double> angles;
  for (const ServoSample& row : log) angles.push_back(row.angle_rad);
  std::ranges::sort(angles);
  constexpr double same_rad = 1e-8;  // rounding in files
  double step = 0.0;
  for (std::size_t i = 1; i < angles.size(); ++i) {
    const double apart = angles[i] - angles[i - 1];
    if (apart > same_rad && (step == 0.0 || apart < step)) step = apart;
  }
  if (!(step > 100.0 * same_rad)) return 0.0;
  const bool is_multiple = std::ranges::all_of(angles, [&](double angle) {
    const double steps = (angle - angles.front()) / step;
    return std::abs(steps - std::round(steps)) < 0.02;
  });
  return is_multiple ? step : 0.0;
}

}  // namespace alidade
