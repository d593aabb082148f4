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
  cannot_tell [[deprecated("undetermined")]] = undetermined,  ///< The former name, for one release.
  no_convergence = 5,
  not_trusted = 6  ///< There is an estimate, with its files, but its own checks contradict it (State::bad).
};

/// State of an answer, or of one of its checks. Shown as ● ◆ ▲ ■ ✕.
enum class State { good, care, bad, refused, not_converged };

/// The result of one check: "coverage: worst 3σ 0.5 px, bottom-left corner".
struct Check {
  std::string name = {};
  State state = State::good;
  std::string text = {};
  double value = 0.0;  ///< The figure that decides the state, in `unit`.
  double limit = 0.0;  ///< The state changes beyond it.
  std::string unit = {};
  std::string figure = {};  ///< Id of the figure in the report that shows the value.
};

/// An assumption: a camera file, the length of a square, a σ given by the user; and its effect on the answer if it were
/// off by its σ or, if none is given, by a typical error.
struct Assumption {
  std::string name = {};        ///< "square_m", "camera.fx"
  double value = 0.0;           ///< NaN if it is not a number.
  std::optional<double> sigma;  ///< Given with it and included in the answer's σ; 0: exact. None: not known.
  double ordinary = 0.0;        ///< If there is no σ: the assumed typical error, in the value's unit.
  double moves = 0.0;           ///< Largest change of a result by that error, in that result's stated σ.
  std::string moved = {};       ///< Name of that result: "fx", "origin_m z".
  double moved_by = 0.0;        ///< Its change, in its unit.
  std::string remedy = {};      ///< What a user can do to have the error included: "give --sigma-square".
};

/// An estimator's assessment of its estimate: a state, one sentence, what to add, and the checks behind it.
struct Verdict {
  State state = State::good;
  ExitCode exit_code = ExitCode::ok;
  std::string sentence;
  std::string to_add;  ///< What the user should do next; empty if nothing.
  std::vector<Check> checks;

  /// Whether there is a usable answer: good, or to be used with care.
  [[nodiscard]] bool ok() const { return state == State::good || state == State::care; }
};

/// The check "assumed": an answer is good only if nothing that is assumed without a σ moves it by more than its own σ.
/// It is also good if nothing is assumed.
[[nodiscard]] Check assumed_check(const std::vector<Assumption>& assumed);

/// Adds the check to the verdict. If it is not good, a good verdict becomes State::care, with `remedy` as advice.
void heed(const Check& check, const std::string& remedy, Verdict& verdict);

/// assumed_check(), then heed().
void heed_assumptions(const std::vector<Assumption>& assumed, Verdict& verdict);

/// A plan becomes State::care if its steps reduce no σ of interest by at least 1 %. `ratio` is the smallest ratio of
/// such a σ after the steps to its present value.
void heed_gain(double ratio, const std::string& remedy, Verdict& verdict);

/// The value with `digits` significant digits, as sentences and checks quote it.
[[nodiscard]] std::string text_of(double value, int digits = 3);

ALIDADE_PUBLIC_END
}  // namespace alidade
