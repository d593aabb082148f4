#include "alidade/calibrate/setup.h"

#include <algorithm>
#include <cmath>

#include "alidade/calibrate/solve/normal_equations.h"
#include "alidade/calibrate/solve/port.h"

namespace alidade {
namespace {

std::string join(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

const Prior* prior_of(const CalibrateConfig& config, const std::string& name) {
  for (const Prior& prior : config.priors) {
    if (prior.name == name) return &prior;
  }
  return nullptr;
}

}  // namespace

CalibrateConfig resolved(CalibrateConfig config) {
  if (!contains(config.fixed, "skew")) config.fixed.insert(config.fixed.begin(), "skew");
  if (config.model == FlatPort::name) config = with_port(std::move(config), config.port);
  for (const std::string& name : config.free) std::erase(config.fixed, name);
  return config;
}

std::vector<std::string> faults(const CalibrateConfig& config) {
  std::vector<std::string> found;
  const auto lens = make_lens(config.model);
  if (!lens) return {"model must be pinhole, brown, kannala_brandt or flat_port, not '" + config.model + "'"};
  const auto names = param_names(*lens);
  const auto known = " of model " + config.model + "; it has " + join(names);
  for (const std::string& name : config.fixed) {
    const bool focal = name == "fx" || name == "fy";
    if (!contains(names, name)) found.push_back("'" + name + "' is no parameter" + known);
    if (focal && !prior_of(config, name)) found.push_back("to hold " + name + ", give its value as a prior");
  }
  for (const Prior& prior : config.priors) {
    if (!contains(names, prior.name)) found.push_back("'" + prior.name + "' is no parameter" + known);
    if (!std::isfinite(prior.value)) found.push_back("the prior of " + prior.name + " must be finite");
    if (!(prior.sigma > 0.0)) found.push_back("the prior's sigma of " + prior.name + " must be positive");
  }
  for (const char* name : {"gap_m", "glass_m", "n_glass", "n_water"}) {
    if (contains(names, name) && !prior_of(config, name))
      found.push_back(std::string("a port needs a value of ") + name);
  }
  if (!(config.outlier_sigmas > 0.0)) found.push_back("outlier_sigmas must be positive");
  if (config.max_iterations < 1) found.push_back("max_iterations must be at least 1");
  return found;
}

std::size_t min_views(const CalibrateConfig& config) {
  return contains(config.fixed, "cx") && contains(config.fixed, "cy") ? 2 : 3;
}

Lens set_up_problem(const Board& board, const CalibrateConfig& config, ImageSize size, BundleProblem& problem) {
  Lens lens = *make_lens(config.model);
  const auto names = param_names(lens);
  Eigen::VectorXd values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(names.size()));
  values[2] = 0.5 * (size.width_px - 1);
  values[3] = 0.5 * (size.height_px - 1);
  problem.prior_value = Eigen::VectorXd::Zero(values.size());
  problem.prior_information = Eigen::VectorXd::Zero(values.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    const bool held = contains(config.fixed, names[i]);
    if (const Prior* prior = prior_of(config, names[i])) {
      values[at] = problem.prior_value[at] = prior->value;
      if (!held) problem.prior_information[at] = 1.0 / (prior->sigma * prior->sigma);
    }
    if (!held) problem.free_lens.push_back(static_cast<int>(i));
  }
  const bool solved = config.board_shape == BoardShape::bow || config.board_shape == BoardShape::free;
  problem.shape = solved ? config.board_shape : BoardShape::flat;
  problem.printed_points = points_in_board(board);
  problem.shape_sigma_m = 0.1 * board.square_m;  // far wider than any board's shape
  return with_params(lens, values);
}

int num_unknown_globals(const BundleProblem& problem) { return num_globals(problem); }

std::vector<double> shape_sigma_z(const BundleProblem& problem, const Eigen::MatrixXd& cov, double variance_scale) {
  std::vector<double> sigmas;
  const auto at = static_cast<Eigen::Index>(problem.free_lens.size());
  if (problem.shape == BoardShape::free) {
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(problem.printed_points.size()); ++i) {
      sigmas.push_back(std::sqrt(variance_scale * cov(at + 3 * i + 2, at + 3 * i + 2)));
    }
  } else if (problem.shape == BoardShape::bow) {
    const BowBasis basis = bow_basis(problem.printed_points);
    for (std::size_t i = 0; i < problem.printed_points.size(); ++i) {
      const Eigen::Vector2d height(basis.along_x[i], basis.along_y[i]);
      sigmas.push_back(std::sqrt(variance_scale * height.dot(cov.block<2, 2>(at, at) * height)));
    }
  }
  return sigmas;
}

std::string name_combination(const BundleProblem& problem, const Lens& lens, const Eigen::VectorXd& direction) {
  const auto names = param_names(lens);
  const double largest = direction.cwiseAbs().maxCoeff();
  std::vector<std::string> carried;
  for (std::size_t i = 0; i < problem.free_lens.size(); ++i) {
    if (std::abs(direction[static_cast<Eigen::Index>(i)]) > 0.1 * largest) {
      carried.push_back(names[static_cast<std::size_t>(problem.free_lens[i])]);
    }
  }
  if (carried.empty()) return "the board's shape";
  return join(carried);
}

}  // namespace alidade
