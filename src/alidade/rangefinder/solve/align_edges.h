#pragma once

#include <span>

#include "alidade/estimation/progress.h"
#include "alidade/rangefinder/edges.h"

namespace alidade {

/// The beam that aligns the scan's edges with those of the photo: minimises the Kullback–Leibler divergence of their
/// density from the image's, const − mean log Q(pixel of an edge), over five parameters by a simplex. Needs no target,
/// but a head, thousands of readings and a scene with depth; a check of the direction to a few mrad, not a calibration.
/// Algorithm of Wang & Li 2020, Table 2; simplex: J. A. Nelder & R. Mead, 1965.
[[nodiscard]] EdgesReport align_edges(std::span<const ScanRow> scan, const GreyImage& photo, const Camera& camera,
                                      const Beam& start, const EdgesConfig& config = {}, const Progress& progress = {});

/// The verdict on such an estimate: never better than `care`.
[[nodiscard]] Verdict edges_verdict(const EdgesReport& report);

}  // namespace alidade
