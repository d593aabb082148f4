#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "alidade/report/calibrate_scene.h"
#include "alidade/report/document.h"

namespace alidade::report {

/// One card of the page. Its title is the question that it answers.
struct Figure {
  std::string id = {};     ///< Checks link to it: #fig-ID.
  std::string title = {};  ///< Plain text.
  std::string note = {};   ///< Plain text beside the title: units, how to read.
  std::string body = {};   ///< Markup.
  std::string good = {};   ///< Plain text: what good looks like.
  int span = 8;            ///< Of 24 columns.
  std::size_t marks = 0;   ///< Rows of its table that are drawn.
};

/// Nothing where the document has no table for the figure.
using MaybeFigure = std::optional<Figure>;

/// Value ± 3σ of every estimate, and the correlation matrix.
[[nodiscard]] MaybeFigure figure_estimate(const Document& document);

[[nodiscard]] MaybeFigure figure_trust(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_residuals(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_worst_photos(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_poses(const CalibrateScene& scene, const Pictures& pictures);
[[nodiscard]] MaybeFigure figure_photo(const CalibrateScene& scene, const Pictures& pictures);
[[nodiscard]] MaybeFigure figure_all_photos(const CalibrateScene& scene, const Pictures& pictures);
[[nodiscard]] MaybeFigure figure_halves(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_lens(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_board(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_next(const CalibrateScene& scene);
[[nodiscard]] MaybeFigure figure_undistorted(const CalibrateScene& scene, const Pictures& pictures);

/// Drawings that several figures show by reference: photos, their arrows, all corners by direction.
[[nodiscard]] std::string shared_drawings(const CalibrateScene& scene, const Pictures& pictures);

[[nodiscard]] MaybeFigure figure_difference(const Document& document);
[[nodiscard]] MaybeFigure figure_diagonal(const Document& document);
[[nodiscard]] MaybeFigure figure_parameters(const Document& document);

/// The first rows of every table, with a download of all.
[[nodiscard]] std::string data_tables(const Document& document);

}  // namespace alidade::report
