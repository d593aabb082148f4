#pragma once

#include <string>
#include <vector>

namespace alidade {

/// Exit codes, the same for every command, so that scripts can tell "bad input" from "no answer" from "our bug".
enum class ExitCode : int { ok = 0, internal_error = 1, usage = 2, bad_input = 3, cannot_tell = 4, no_convergence = 5 };

/// How an answer, or one check of it, stands. Shown as ● ◆ ▲ ■ ✕.
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

/// What an estimator says of its own answer: a state, one sentence, what to add, and the checks behind it.
struct Verdict {
  State state = State::good;
  ExitCode exit_code = ExitCode::ok;
  std::string sentence;
  std::string to_add;  ///< What the person should do next; empty if nothing.
  std::vector<Check> checks;
};

/// The value with so many significant digits, as sentences and checks quote it.
[[nodiscard]] std::string text_of(double value, int digits = 3);

}  // namespace alidade
