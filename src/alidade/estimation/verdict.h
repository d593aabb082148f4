#pragma once

#include <optional>
#include <string>
#include <vector>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Exit codes, the same for every command, so that scripts can distinguish "bad input" from "no answer" from "our bug".
enum class ExitCode : int {
  ok = 0,
  internal_error = 1,
  usage = 2,
  bad_input = 3,
  undetermined = 4,
  cannot_tell [[deprecated("undetermined")]] = undetermined,  ///< Its former name, for one release.
  no_convergence = 5,
  not_trusted = 6  ///< There is an estimate, and its files, but its own checks speak against it (State::bad).
};

/// State of an answer, or of one check of it. Shown as ● ◆ ▲ ■ ✕.
enum class State { good, care, bad, refused, not_converged };

/// One thing that was checked: "coverage: worst 3σ 0.5 px, bottom-left corner".
struct Check {
  std::string name = {};
  State state = State::good;
  std::string text = {};
  double value = 0.0;  ///< The figure that decides, in `unit`.
  double limit = 0.0;  ///< Beyond it the state changes.
  std::string unit = {};
  std::string figure = {};  ///< Id of the figure in the report that shows it.
};

/// An assumption: a camera file, the length of a square, a σ given by the user. Its effect on the
/// answer if it were off by its σ or, where none is given, by a typical error.
struct Assumption {
  std::string name = {};        ///< "square_m", "camera.fx"
  double value = 0.0;           ///< NaN where it is not a number.
  std::optional<double> sigma;  ///< Given with it and included in the answer's σ; 0: exact. None: not known.
  double ordinary = 0.0;        ///< Where there is no σ: the error supposed, in the value's unit.
  double moves = 0.0;           ///< Largest move of a result for that error, in that result's stated σ.
  std::string moved = {};       ///< Which result that is: "fx", "origin_m z".
  double moved_by = 0.0;        ///< By how much, in its unit.
  std::string remedy = {};      ///< What a user can do to have it included: "give --sigma-square".
};

/// The assessment of an estimate by its estimator: a state, one sentence, what to add, and the checks behind it.
struct Verdict {
  State state = State::good;
  ExitCode exit_code = ExitCode::ok;
  std::string sentence;
  std::string to_add;  ///< What the user should do next; empty if nothing.
  std::vector<Check> checks;

  /// Whether there is a usable answer: good, or with care.
  [[nodiscard]] bool ok() const { return state == State::good || state == State::care; }
};

/// The check "assumed": an answer is good only where nothing assumed without a σ moves it by more than its own σ. With
/// nothing assumed it is good.
[[nodiscard]] Check assumed_check(const std::vector<Assumption>& assumed);

/// Adds the check to the verdict. A good verdict becomes State::care if the check is not good, and says what to do.
void heed(const Check& check, const std::string& remedy, Verdict& verdict);

/// Both of the above.
void heed_assumptions(const std::vector<Assumption>& assumed, Verdict& verdict);

/// A plan whose steps lower nothing that matters by a hundredth becomes State::care. `ratio`: the least of what is
/// known after them over the same now.
void heed_gain(double ratio, const std::string& remedy, Verdict& verdict);

/// The value with so many significant digits, as sentences and checks quote it.
[[nodiscard]] std::string text_of(double value, int digits = 3);

ALIDADE_PUBLIC_END
}  // namespace alidade
