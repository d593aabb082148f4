#include "alidade/track/checks/lean.h"

#include <cmath>
#include <utility>

#include "alidade/estimation/verdict.h"

namespace alidade {
namespace {

/// A target that is badly described by --method also biases the innovations, by up to half of these: see scenario C.
constexpr double min_along = 0.6, min_slope = 1.2;

void take_if_worse(std::string text, double size, double least, double z, Lean& worst) {
  constexpr double min_z = 6.0;
  if (std::abs(size) > least && std::abs(z) > min_z && std::abs(size) > worst.size)
    worst = {std::move(text), std::abs(size)};
}

void take_worst_of(const HeadInnovations& of, const std::string& head, Lean& worst) {
  const double root = std::sqrt(static_cast<double>(of.num));
  for (int k = 0; k < 2; ++k) {
    take_if_worse(head + " sees the target to one side of where it is expected, by " +
                      text_of(std::abs(of.mean[k]), 2) + "σ in " + (k == 0 ? "u" : "v") +
                      ": its mounting or an encoder's zero",
                  of.mean[k], min_mean_lean, root * of.mean[k], worst);
    take_if_worse("the innovations of " + head + " grow with the position in the image, by " +
                      text_of(std::abs(of.position_slope[k]), 2) + "σ a quarter of it: its focal length, or a scale",
                  of.position_slope[k], min_slope, of.position_slope[k] * std::sqrt(of.position_squares), worst);
  }
  take_if_worse(head + " sees the target " + (of.along > 0.0 ? "ahead of" : "behind") + " where it is expected, by " +
                    text_of(std::abs(of.along), 2) +
                    "σ along its motion: clocks, or a target that --method does not describe",
                of.along, min_along, root * of.along, worst);
}

}  // namespace

Lean worst_lean(const TrackReport& report, std::span<const RigHead> heads) {
  Lean worst;
  for (std::size_t h = 0; h < report.innovations.size() && h < heads.size(); ++h)
    take_worst_of(report.innovations[h], "head " + std::to_string(heads[h].head.id), worst);
  return worst;
}

Check nis_check(const TrackReport& report, bool is_stated) {
  constexpr double good_nis_low = 0.6;
  const double nis = report.nis_per_dof;
  const bool is_smaller = nis < good_nis_low, is_supposed = is_smaller && !is_stated;
  const std::string px = text_of(report.sigma_px, 2) + " px", of_it = " the " + px + " estimated from it";
  const std::string stated = report.sigma_px_is_found ? of_it : " stated";
  std::string text = "innovations as large as predicted";
  if (nis > good_nis_high) {
    text = "noise is larger than" + stated + ", or the rig is wrong";
  } else if (is_supposed) {
    text = "noise is smaller than the " + px + " supposed: σ is up to " + text_of(1.0 / std::sqrt(nis), 2) +
           " times too wide; --sigma-px states it";
  } else if (is_smaller) {
    text = "noise is smaller than" + stated;
  } else if (report.sigma_px_is_found) {
    text += " with noise of " + px + ", which is estimated from them";
  }
  const bool is_good = nis <= good_nis_high && (!is_smaller || is_supposed);
  return {"NIS",
          is_good         ? State::good
          : nis > max_nis ? State::bad
                          : State::care,
          text_of(nis, 3) + " per degree of freedom: " + text,
          nis,
          good_nis_high,
          "1",
          "track"};
}

}  // namespace alidade
