#include "alidade/observe/checks/constant_spans.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "alidade/geometry/decompositions.h"
#include "alidade/observe/solve/solve_once.h"

namespace alidade {
namespace {

constexpr double agree_within = 5.0;  // σ
constexpr Eigen::Index num_intrinsics = 4;
constexpr const char* advice =
    ": more has changed than fx, fy, cx, cy (distortion or a roll that goes with the zoom, a bump of the camera); part "
    "the log at the zooms and observe each part, or calibrate at each zoom";

/// The result of the rows of one constant span alone.
struct SpanAnswer {
  HybridObserver::ConstantSpan span;
  ObserveSolution report;

  [[nodiscard]] std::string words() const {
    return "from " + row_time_text(span.from_s) + " to " + row_time_text(span.until_s);
  }
};

/// Longest span first, then the current one, then by length; at most 8, which takes about as long as the whole log.
std::vector<HybridObserver::ConstantSpan> spans_to_compare(std::vector<HybridObserver::ConstantSpan> spans) {
  constexpr double shortest_s = 1.0;
  constexpr std::size_t most = 8;
  std::erase_if(spans, [](const auto& span) { return span.duration_s() < shortest_s; });
  std::ranges::stable_sort(spans, std::ranges::greater{}, &HybridObserver::ConstantSpan::duration_s);
  if (spans.size() < 2) return {};
  std::stable_sort(spans.begin() + 1, spans.end(),
                   [](const auto& a, const auto& b) { return a.is_current && !b.is_current; });
  spans.resize(std::min(spans.size(), most));
  return spans;
}

class SpanSolver {
 public:
  SpanSolver(const RotationLog& log, const ObserveSetup& config, const ObserveSolution& report,
             const Progress& progress)
      : log_(log), config_(config), report_(report), progress_(progress) {
    header_.source = log.source;
    header_.num_points = log.num_points;
    header_.range_point = log.range_point;
    header_.has_roll_rate = log.has_roll_rate;
    header_.has_velocity = log.has_velocity;
    header_.sigma_scale = log.sigma_scale;
    header_.sigma_parallax = log.sigma_parallax;
    config_.method = ObserveMethod::batch;
    config_.width_px = report.width_px;
    config_.height_px = report.height_px;
  }

  /// Estimates what the whole log estimates or, if `is_searched`, also what the span's own residuals indicate.
  [[nodiscard]] std::optional<SpanAnswer> answer_of(const HybridObserver::ConstantSpan& span, bool is_searched) {
    RotationLog part = header_;
    for (const RotationRow& row : log_.rows)
      if (span.contains(row.t_s)) part.rows.push_back(row);
    const auto k = intrinsics_before(span.until_s, log_, report_.steps);
    config_.start = k ? *k : report_.steps.back().values();
    const auto solve = is_searched ? solve_intrinsics : solve_as_given;
    SpanAnswer answer{span, solve(part, config_, progress_)};
    if (answer.report.status != ObserveSolution::Status::ok) return std::nullopt;
    if (!is_searched) {
      answer.report.estimated = report_.estimated;
      answer.report.estimated_errors = report_.estimated_errors;
    }
    return answer;
  }

  [[nodiscard]] std::vector<SpanAnswer> answers_of(const std::vector<HybridObserver::ConstantSpan>& spans,
                                                   bool is_searched) {
    std::vector<SpanAnswer> answers;
    for (const HybridObserver::ConstantSpan& span : spans)
      if (auto answer = answer_of(span, is_searched)) answers.push_back(*std::move(answer));
    return answers;
  }

 private:
  const RotationLog& log_;
  ObserveSetup config_;
  const ObserveSolution& report_;
  const Progress& progress_;
  RotationLog header_;
};

Eigen::VectorXd difference_of(const ObserveReport& a, const ObserveReport& b, Eigen::Index from, Eigen::Index size) {
  Eigen::VectorXd difference(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const auto at = static_cast<std::size_t>(from + i);
    difference[i] = a.quantities[at].value - b.quantities[at].value;
  }
  return difference;
}

/// The difference of two answers in the `size` quantities from index `from`, if it exceeds their joint σ.
struct Disagreement {
  Eigen::Index worst = 0;
  double z = 0.0;  ///< Difference in σ of the quantity that differs most.
};

std::optional<Disagreement> disagreement_of(const ObserveReport& a, const ObserveReport& b, Eigen::Index from,
                                            Eigen::Index size) {
  if (size <= 0 || a.covariance.rows() < from + size || b.covariance.rows() < from + size) return std::nullopt;
  const Eigen::VectorXd difference = difference_of(a, b, from, size);
  const Eigen::MatrixXd cov = a.covariance.block(from, from, size, size) + b.covariance.block(from, from, size, size);
  const Ldlt solved(cov);
  if (!cov.allFinite() || !solved.is_positive()) return std::nullopt;
  if (!(difference.dot(solved.solve(difference)) > chi2_quantile(static_cast<int>(size), agree_within)))
    return std::nullopt;
  Disagreement found;
  const Eigen::ArrayXd z = difference.array().abs() / cov.diagonal().array().sqrt();
  found.z = z.maxCoeff(&found.worst);
  found.worst += from;
  return found;
}

std::string value_text(const ObservedQuantity& quantity) {
  return text_of(quantity.value, 3) + " ± " + text_of(quantity.sigma, 2);
}

Check check_of(std::string text, double z) {
  return {"constant spans agree", State::care, std::move(text) + advice, z, agree_within, "σ", "residuals"};
}

std::optional<Check> differs(const SpanAnswer& span, const SpanAnswer& longest) {
  const Eigen::Index size = longest.report.covariance.rows() - num_intrinsics;
  const auto found = disagreement_of(span.report, longest.report, num_intrinsics, size);
  if (!found) return std::nullopt;
  const auto at = static_cast<std::size_t>(found->worst);
  return check_of(span.words() + " " + span.report.quantities[at].name + " is " +
                      value_text(span.report.quantities[at]) + ", " + longest.words() + " " +
                      value_text(longest.report.quantities[at]),
                  found->z);
}

/// A cause that the residuals of the whole log do not indicate. (The filter follows a slowly drifting focal length.)
std::optional<Check> indicates_more(const SpanAnswer& span, const ObserveSolution& report) {
  const CauseScore* most = nullptr;
  for (const CauseScore& cause : span.report.causes) {
    const auto known = std::ranges::find(report.causes, cause.name, &CauseScore::name);
    const bool is_known = known != report.causes.end() && known->z >= asked_beyond(report);
    if (is_known || cause.z < asked_beyond(span.report) || cause.name.starts_with("focal length")) continue;
    if (most == nullptr || cause.gain > most->gain) most = &cause;
  }
  if (most == nullptr) return std::nullopt;
  return check_of(span.words() + " the residuals indicate " + most->name + " (" + text_of(most->z, 2) + "σ)", most->z);
}

std::optional<Check> ends_elsewhere(const SpanAnswer& span, const ObserveSolution& report) {
  if (!span.span.is_current) return std::nullopt;
  const auto found = disagreement_of(span.report, report, 0, num_intrinsics);
  if (!found) return std::nullopt;
  const auto at = static_cast<std::size_t>(found->worst);
  return check_of("the rows " + span.words() + " by themselves have " + report.quantities[at].name + " " +
                      value_text(span.report.quantities[at]) + ", the filter ends with " +
                      value_text(report.quantities[at]),
                  found->z);
}

/// Error of fx, fy, cx, cy if the other parameters were those of another span: regression from their covariance.
Eigen::Array4d errors_by_the_rest(const ObserveSolution& span, const ObserveSolution& other) {
  const Eigen::Index size = span.covariance.rows() - num_intrinsics;
  const bool is_same =
      std::ranges::equal(span.quantities, other.quantities, {}, &ObservedQuantity::name, &ObservedQuantity::name);
  if (size <= 0 || !is_same || !span.covariance.allFinite()) return Eigen::Array4d::Zero();
  const Eigen::VectorXd difference = difference_of(span, other, num_intrinsics, size);
  const Ldlt rest(span.covariance.bottomRightCorner(size, size));
  return (span.covariance.topRightCorner(num_intrinsics, size) * rest.solve(difference)).array().abs();
}

/// Possible error of the filter's rows, largest per intrinsic, over fx: at the ends of the spans,
/// or between them if the parameters other than fx, fy, cx, cy were those of the longest span.
Eigen::Array4d filter_errors(const std::vector<SpanAnswer>& answers, const RotationLog& log,
                             const std::vector<IntrinsicsEstimate>& rows) {
  Eigen::Array4d largest = Eigen::Array4d::Zero();
  for (const SpanAnswer& answer : answers) {
    const auto k = intrinsics_before(answer.span.until_s, log, rows);
    const Eigen::Vector4d filtered = k ? *k : rows.back().values(), own = answer.report.steps.back().values();
    const Eigen::Array4d by_the_rest = errors_by_the_rest(answer.report, answers.front().report);
    largest = largest.max((filtered - own).array().abs().max(by_the_rest) / own[0]);
  }
  return largest;
}

/// Gives each span's rows its own adjustment; σ of the rows between them (zooms) includes the error of the filter.
void take_rows(const std::vector<SpanAnswer>& answers, const RotationLog& log, std::vector<IntrinsicsEstimate>& rows) {
  const Eigen::Array4d off = filter_errors(answers, log, rows);
  for (IntrinsicsEstimate& row : rows) row.sigma = (row.sigma.array().square() + (row.fx * off).square()).sqrt();
  for (const SpanAnswer& answer : answers) {
    for (std::size_t k = 0; k < rows.size(); ++k) {
      if (!answer.span.contains(log.rows[k].t_s) || !rows[k].has_value) continue;
      const IntrinsicsEstimate own = answer.report.steps.back(), filtered = rows[k];
      rows[k] = own;
      rows[k].nis = filtered.nis;
      rows[k].nis_dof = filtered.nis_dof;
      rows[k].event = filtered.event;
      rows[k].point = filtered.point;
    }
  }
}

/// The last span's answer becomes that of the log; checks of separability in the whole log do not apply to it.
void take_end(SpanAnswer& last, ObserveSolution& report) {
  std::erase_if(report.side_checks,
                [](const Check& check) { return check.name == "separable" || check.name == "determined"; });
  ObserveSolution own = std::move(last.report);
  own.steps = std::move(report.steps);
  own.events = std::move(report.events);
  own.constant_spans = std::move(report.constant_spans);
  own.side_checks.insert(own.side_checks.end(), report.side_checks.begin(), report.side_checks.end());
  own.nis_per_dof = report.nis_per_dof;
  own.misread = report.misread;
  own.reference_from_s = last.span.from_s;
  own.reference_until_s = last.span.until_s;
  report = std::move(own);
}

/// If the log does not end with such a span, the final camera gets the σ of the last row.
void widen_end(ObserveSolution& report) {
  const Eigen::Vector4d sigma = report.steps.back().sigma;
  for (Eigen::Index i = 0; i < sigma.size(); ++i) {
    ObservedQuantity& quantity = report.quantities[static_cast<std::size_t>(i)];
    report.covariance(i, i) += std::max(0.0, sigma[i] * sigma[i] - quantity.sigma * quantity.sigma);
    quantity.sigma = std::max(quantity.sigma, sigma[i]);
  }
}

bool is_unexplained(const SpanAnswer& answer) { return indicates_more(answer, ObserveSolution{}).has_value(); }

void take_answers(std::vector<SpanAnswer>& answers, const RotationLog& log, ObserveSolution& report) {
  if (answers.empty()) return;
  take_rows(answers, log, report.steps);
  const auto last = std::ranges::find_if(answers, [](const SpanAnswer& answer) { return answer.span.is_current; });
  if (last == answers.end()) return widen_end(report);
  report.side_checks.push_back({"from the last rows", State::good,
                                "the camera is of the rows " + last->words() + " alone", 0.0, 0.0, "", "residuals"});
  take_end(*last, report);
}

template <typename CheckOf>
std::optional<Check> first_of(const std::vector<SpanAnswer>& answers, const CheckOf& check_of) {
  for (const SpanAnswer& answer : answers)
    if (auto check = check_of(answer)) return check;
  return std::nullopt;
}

}  // namespace

void compare_constant_spans(const RotationLog& log, const ObserveSetup& config, const Progress& progress,
                            ObserveSolution& report) {
  const auto spans = spans_to_compare(report.constant_spans);
  if (spans.empty() || config.rotation != RotationKnowledge::known || report.mounting_step) return;
  SpanSolver solver(log, config, report, progress);
  std::vector<SpanAnswer> answers = solver.answers_of(spans, false);
  const std::optional<Check> more = first_of(answers, [&](const auto& each) { return indicates_more(each, report); });
  std::optional<Check> other = first_of(answers, [&](const auto& each) { return differs(each, answers.front()); });
  if (!other) other = first_of(answers, [&](const auto& each) { return ends_elsewhere(each, report); });
  if (more && config.estimate_auto) answers = solver.answers_of(spans, true);
  for (const std::optional<Check>& check : {more, other})
    if (check) report.side_checks.push_back(*check);
  std::erase_if(answers, is_unexplained);
  if (more || other) take_answers(answers, log, report);
}

}  // namespace alidade
