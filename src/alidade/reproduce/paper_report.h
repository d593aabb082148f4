#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"

namespace alidade::reproduce {

inline constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

/// What became of a claim when it was tried.
enum class Holds {
  reproduced,       ///< It comes out as printed.
  in_shape,         ///< It comes out in kind: half of the draws, other gains, another reading. The words say which.
  not_reproducible  ///< It does not; the words say why.
};

/// The words for it: reproduced, reproduced in shape, not reproducible.
[[nodiscard]] std::string_view holds_name(Holds holds);

/// One statement of a paper, tried. NaN where there is no such number.
struct Claim {
  std::string id;                 ///< "exp2-settles-again"
  std::string quantity;           ///< What is compared, in words.
  std::string unit = {};          ///< Of the four parameters.
  double printed = not_a_number;  ///< What the paper prints.
  double rerun = not_a_number;    ///< The paper's method, re-run by us.
  double ours = not_a_number;     ///< Our default method on the same data.
  double bound = not_a_number;    ///< The Cramér–Rao bound, where known.
  Holds holds = Holds::not_reproducible;
  std::string words = {};   ///< How it differs from what is printed, and why.
  std::string figure = {};  ///< Of the experiment's figures, the one that shows it.
};

/// Data of a figure: the first column goes across, the others up. Columns that begin with "printed" are the
/// paper's, with "ours" its method's as we run it, with "best" our own's: names that scripts know.
struct FigureTable {
  std::string id;  ///< "4" of fig_4; a table that is printed as one begins with "table".
  std::vector<std::pair<std::string, std::vector<double>>> columns;
  std::string title = {};                ///< What is drawn.
  std::string caption = {};              ///< How to read it, and where it is not the paper's.
  std::string across = {}, up = {};      ///< Of the axes, without units; empty: by the columns' names.
  std::vector<std::string> labels = {};  ///< Of the rows, where they are cases.
};

/// The same with its words.
[[nodiscard]] FigureTable titled(FigureTable figure, std::string title, std::string caption, std::string up = {});

struct Experiment {
  std::string id;      ///< "exp1"
  std::string title;   ///< One line.
  std::string method;  ///< One paragraph: what was simulated and run.
  std::string chosen;  ///< What the paper does not say, and what was taken; empty: nothing.
  std::vector<Claim> claims = {};
  std::vector<FigureTable> figures = {};
};

struct PaperReport {
  std::string paper;      ///< "fang2011"
  std::string reference;  ///< Authors, title, year.
  std::vector<Experiment> experiments;

  [[nodiscard]] std::size_t count(Holds holds) const;
  [[nodiscard]] std::size_t num_claims() const;
};

struct ReproduceConfig {
  std::uint64_t seed = 1;  ///< Another one draws other points, noise and boards.
  bool quick = false;      ///< Fewer draws.
  /// A clock in seconds, for tables of times. None: times are omitted.
  std::function<double()> clock_s = {};
  Progress progress = {};
};

/// The p-quantile, by the value at or next to it; infinite values are the largest. NaN of nothing.
[[nodiscard]] double quantile_of(std::vector<double> values, double p);
[[nodiscard]] double share_within(const std::vector<double>& values, double limit);

/// A claim "at most `limit`", tried on many draws: reproduced where nine in ten keep the limit, in shape where half of
/// them keep one and a half times it. The same rule for every such claim, so that no one of them is judged kindly.
[[nodiscard]] Holds at_most(const std::vector<double>& values, double limit);

/// A figure that is printed: reproduced where the re-run is within `share` of it, in shape within three times that.
[[nodiscard]] Holds near_to(double rerun, double printed, double share);

/// How many claims hold. The state is good where all do as printed, care otherwise; the exit code is always 0: that a
/// claim does not hold is an answer.
[[nodiscard]] Verdict reproduce_verdict(const PaperReport& report);

}  // namespace alidade::reproduce
