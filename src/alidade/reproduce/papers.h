#pragma once

#include <span>

#include "alidade/reproduce/paper_report.h"

namespace alidade::reproduce {

/// Y. Fang, X. Liu, B. Li & X. Zhang, "A global exponential observer for camera calibration", 2011: experiments 1–3,
/// figures 3–8, and what is said to be enough.
[[nodiscard]] PaperReport reproduce_fang2011(const ReproduceConfig& config);

/// Wang & Li, "Calibration method of laser range finder and camera in information fusion process", 2020: tables 1 and
/// 2, figures 6–9.
[[nodiscard]] PaperReport reproduce_wang2020(const ReproduceConfig& config);

/// Xiahou et al., "Modeling and Simulation for Target Tracking System Based on Dual-Pan-Tilt Camera", 2015: initial
/// geometry, figures 4 and 5, servo loop.
[[nodiscard]] PaperReport reproduce_xiahou2015(const ReproduceConfig& config);

/// Xu & Xu, "Underwater monocular localization with lens distortion": figure 10, three lenses.
[[nodiscard]] PaperReport reproduce_xu_underwater(const ReproduceConfig& config);

struct Paper {
  const char* name;
  const char* summary;
  PaperReport (*run)(const ReproduceConfig&);
};
/// All of them, in the order of the command's help.
[[nodiscard]] std::span<const Paper> papers();

}  // namespace alidade::reproduce
