#include "alidade/rig/plan/next_view.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "alidade/board/board_reach.h"
#include "alidade/estimation/config_error.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/rig/rig_frame.h"
#include "alidade/rig/rig_work.h"

namespace alidade {
namespace {

constexpr std::size_t views_per_position = 3;
constexpr double margin_share = 0.02;  // of the image's width that a board keeps from its edge

/// Angles at which a rig is evaluated: the centre of the limits, and their corners.
std::vector<Eigen::Vector2d> angles_within(const ViewConfig& config) {
  const Eigen::Vector2d low = degree * Eigen::Vector2d(config.min_pan_deg, config.min_tilt_deg);
  const Eigen::Vector2d high = degree * Eigen::Vector2d(config.max_pan_deg, config.max_tilt_deg);
  return {0.5 * (low + high), low, {low.x(), high.y()}, high, {high.x(), low.y()}};
}

/// The parameters indicated by the residuals, by their names.
FreedParams freed_params(const RigReport& report) {
  FreedParams freed;
  for (const RigFreed& one : report.freed) {
    for (const RigHead& rig_head : report.rig.heads) {
      const std::string head = "head" + std::to_string(rig_head.head.id) + ".";
      for (int param = 0; param <= tilt_backlash_param; ++param)
        if (one.name == head + rig_param_name(param)) freed[rig_head.head.id].push_back(param);
    }
  }
  return freed;
}

/// A rig with the information of its views, and what more of them would add.
class ViewPlanner {
 public:
  ViewPlanner(const RigCalibration& now, const ViewConfig& config)
      : now_(now), config_(config), points_(points_in_board(*now.config.board)) {
    set_problem();
    system_ = rig_system(problem_, state_, weights_);
    if (!system_) throw ConfigError("the views do not fit the rig");
    information_ = system_->information();
    set_sigma_rows();
    const auto sigma = sigma_with(information_);
    if (!sigma) throw ConfigError("the rig is not determined");
    plan_.now = plan_.with_next = *sigma;
  }

  ViewPlan planned() && {
    for (std::size_t head = 0; head < state_.heads.size(); ++head) {
      for (std::size_t board = 0; board < now_.boards.size(); ++board) try_standing(head, board);
      try_new_positions(head);
    }
    return std::move(plan_);
  }

 private:
  void set_problem() {
    const FreedParams freed = freed_params(now_);
    const Progress silent;
    Work work{now_.measured, now_.config, silent, freed, {}, {}, {}, now_.rig.heads, {}, {}, {}};
    for (const RigHead& rig_head : now_.rig.heads) work.ids.push_back(rig_head.head.id);
    choose_free(work);
    problem_ = std::move(work.problem);
    // The direction of approach is unknown for future views: backlash contributes nothing here.
    for (std::vector<int>& free : problem_.free)
      std::erase_if(free, [](int param) { return param >= pan_backlash_param; });
    problem_.points_in_board = points_;
    problem_.sigma_px = now_.sigma_px;
    problem_.sigma_encoder_rad = now_.sigma_encoder_rad;
    state_.heads = now_.rig.heads;
    state_.backlash_rad = now_.backlash_rad;
    for (const RigBoard& board : now_.boards) state_.world_from_board.push_back(board.world_from_board);
    for (std::size_t v = 0; v < now_.measured.size(); ++v) add_view(now_.measured[v], now_.views[v]);
  }

  void add_view(const HeadView& view, const HeadViewFit& fit) {
    const auto head = std::ranges::find(state_.heads, view.head, [](const RigHead& one) { return one.head.id; });
    const auto board = std::ranges::find(now_.boards, view.board, &RigBoard::board);
    if (!fit.used || head == state_.heads.end() || board == now_.boards.end()) return;
    problem_.views.push_back({&view, static_cast<std::size_t>(head - state_.heads.begin()),
                              static_cast<std::size_t>(board - now_.boards.begin())});
    state_.corrections_rad.push_back(fit.reading_correction_rad);
    weights_.push_back(1.0);
  }

  /// Derivatives of where cameras stand to each other, by the free parameters: six rows for each pair of angles.
  void set_sigma_rows() {
    const WorldAtCamera world =
        world_at_camera(problem_, state_, Eigen::MatrixXd::Identity(problem_.num_free(), problem_.num_free()));
    const std::vector<Eigen::Vector2d> angles = angles_within(config_);
    const std::size_t num_heads = state_.heads.size();
    std::vector<Eigen::MatrixXd> blocks;
    for (std::size_t h = num_heads == 1 ? 0 : 1; h < num_heads; ++h) {
      for (const Eigen::Vector2d& first_rad : angles)
        for (const Eigen::Vector2d& second_rad : angles)
          blocks.emplace_back(relative_jacobian(world.rig, 0, first_rad, h, second_rad) * world.J);
    }
    sigma_rows_.resize(6 * static_cast<Eigen::Index>(blocks.size()), problem_.num_free());
    for (std::size_t i = 0; i < blocks.size(); ++i)
      sigma_rows_.middleRows<6>(6 * static_cast<Eigen::Index>(i)) = blocks[i];
  }

  /// None where the information does not determine the rig.
  [[nodiscard]] std::optional<RigSigma> sigma_with(const Eigen::MatrixXd& information) const {
    const Eigen::MatrixXd cov = inverse_symmetric(information);
    if (!cov.allFinite() || !(cov.diagonal().minCoeff() > 0.0)) return std::nullopt;
    const Eigen::VectorXd variances = (sigma_rows_ * cov).cwiseProduct(sigma_rows_).rowwise().sum();
    double angle2 = 0.0, length2 = 0.0;
    for (Eigen::Index i = 0; i < variances.size(); i += 6) {
      length2 = std::max(length2, variances.segment<3>(i).sum());
      angle2 = std::max(angle2, variances.segment<3>(i + 3).sum());
    }
    return RigSigma{std::sqrt(angle2), std::sqrt(length2)};
  }

  static double score(const RigSigma& sigma) {
    return 0.5 * (std::log(std::max(1e-12, sigma.angle_rad)) + std::log(std::max(1e-12, sigma.length_m)));
  }

  [[nodiscard]] Eigen::Vector3d centre_in_board() const {
    Eigen::AlignedBox3d box;
    for (const auto& point : points_) box.extend(point);
    return box.center();
  }

  /// What a head would see of a board at those readings; none where that is not all of it, or out of its limits.
  [[nodiscard]] std::optional<HeadView> predicted(std::size_t head, const Rigid3& world_from_board,
                                                  const Eigen::Vector2d& reading_rad) const {
    const Eigen::Vector2d at_deg = reading_rad / degree;
    const bool is_within = at_deg.x() >= config_.min_pan_deg && at_deg.x() <= config_.max_pan_deg &&
                           at_deg.y() >= config_.min_tilt_deg && at_deg.y() <= config_.max_tilt_deg;
    if (!is_within) return std::nullopt;
    const RigHead& rig_head = state_.heads[head];
    const TurnedHead turned(rig_head.head, reading_rad);
    const double margin_px = margin_share * rig_head.camera.width_px;
    HeadView view;
    view.pan_tilt_rad = reading_rad;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const auto seen = project(turned, rig_head.camera, world_from_board * points_[i]);
      const bool is_inside = seen && seen->px.x() > margin_px && seen->px.y() > margin_px &&
                             seen->px.x() < rig_head.camera.width_px - 1 - margin_px &&
                             seen->px.y() < rig_head.camera.height_px - 1 - margin_px;
      if (!is_inside) return std::nullopt;
      view.seen.corners.push_back({.index = static_cast<int>(i), .px = seen->px});
    }
    return view;
  }

  /// The view in which the board's centre is seen at a fraction of the image, or as near to that as the whole board
  /// fits.
  [[nodiscard]] std::optional<HeadView> view_at(std::size_t head, const Rigid3& world_from_board,
                                                const Eigen::Vector2d& share) const {
    const RigHead& rig_head = state_.heads[head];
    const Eigen::Vector2d half(0.5, 0.5), size(rig_head.camera.width_px - 1, rig_head.camera.height_px - 1);
    for (const double reach : {1.0, 0.8, 0.6, 0.4}) {
      const auto ray = unproject(rig_head.camera, (half + reach * (share - half)).cwiseProduct(size));
      const auto reading_rad = ray ? aim(rig_head.head, world_from_board * centre_in_board(), *ray) : std::nullopt;
      auto view = reading_rad ? predicted(head, world_from_board, *reading_rad) : std::nullopt;
      if (view) return view;
    }
    return std::nullopt;
  }

  /// The information with some more views of one board; `board`: its index, that of a new one the next.
  [[nodiscard]] std::optional<Eigen::MatrixXd> information_with(const std::vector<HeadView>& views, std::size_t head,
                                                                std::size_t board,
                                                                const Rigid3& world_from_board) const {
    RigProblem more = problem_;
    RigState state = state_;
    more.views.clear();
    for (const HeadView& view : views) more.views.push_back({&view, head, 0});
    state.world_from_board = {world_from_board};
    state.corrections_rad.assign(views.size(), Eigen::Vector2d::Zero());
    state.backlash_rad.clear();
    const auto added = rig_system(more, state, std::vector<double>(views.size(), 1.0));
    if (!added) return std::nullopt;
    RigSystem::BoardBlock block = added->boards.front();
    Eigen::MatrixXd sum = information_ + added->U;
    if (board < system_->boards.size()) {
      const RigSystem::BoardBlock& old = system_->boards[board];
      sum += old.W.transpose() * Ldlt(old.V).solve_each(old.W);
      block.V += old.V;
      block.W += old.W;
    }
    sum -= block.W.transpose() * Ldlt(block.V).solve_each(block.W);
    return sum;
  }

  void weigh(const std::vector<HeadView>& views, std::size_t head, std::size_t board, const Rigid3& world_from_board) {
    const auto information = information_with(views, head, board, world_from_board);
    const auto sigma = information ? sigma_with(*information) : std::nullopt;
    if (!sigma) return;
    const double gain = (score(plan_.now) - score(*sigma)) / static_cast<double>(views.size());
    if (!(gain > 0.0) || (plan_.next && gain <= plan_.next->gain)) return;
    const RigHead& rig_head = state_.heads[head];
    NextView next{.head = rig_head.head.id,
                  .pan_tilt_rad = views.front().pan_tilt_rad,
                  .world_from_board = world_from_board,
                  .centre_px = Eigen::Vector2d::Zero(),
                  .gain = gain};
    next.is_new_position = board >= now_.boards.size();
    next.board = next.is_new_position ? new_number() : now_.boards[board].board;
    const Eigen::Vector3d centre_in_world = world_from_board * centre_in_board();
    if (const auto px = project(rig_head, next.pan_tilt_rad, centre_in_world)) next.centre_px = px->px;
    next.cam_from_board = cam_from_world(rig_head.head, next.pan_tilt_rad) * world_from_board;
    plan_.next = next;
    plan_.with_next = *sigma;
  }

  [[nodiscard]] int new_number() const {
    int last = 0;
    for (const HeadView& view : now_.measured) last = std::max(last, view.board);
    return last + 1;
  }

  void try_standing(std::size_t head, std::size_t board) {
    const Rigid3& world_from_board = now_.boards[board].world_from_board;
    for (int cell = 0; cell < 25; ++cell) {
      const Eigen::Vector2d share(0.1 + 0.2 * (cell % 5), 0.1 + 0.2 * (cell / 5));
      if (const auto view = view_at(head, world_from_board, share)) weigh({*view}, head, board, world_from_board);
    }
  }

  /// The board before the camera, wherever the head can look, near and far, rotated as a user can.
  void try_new_positions(std::size_t head) {
    const double tilt_rad = config_.max_tilt_of_board_deg * degree;
    const std::array<Eigen::Vector3d, 3> turns{Eigen::Vector3d{0, 0, 0}, {tilt_rad, 0, 0}, {0, tilt_rad, 0}};
    for (int cell = 0; cell < 9; ++cell) {
      const Eigen::Vector2d share(0.15 + 0.35 * (cell % 3), 0.15 + 0.35 * (cell / 3));
      const Eigen::Vector2d reading_deg(
          config_.min_pan_deg + share.x() * (config_.max_pan_deg - config_.min_pan_deg),
          config_.min_tilt_deg + share.y() * (config_.max_tilt_deg - config_.min_tilt_deg));
      const Rigid3 world_from_camera = world_from_cam(state_.heads[head].head, degree * reading_deg);
      for (const double way : {0.1, 0.6}) {
        const double distance_m = config_.min_range_m + way * (config_.max_range_m - config_.min_range_m);
        for (const Eigen::Vector3d& turn : turns) {
          const Eigen::Quaterniond rotation = exp_so3(turn);
          const Eigen::Vector3d centre(0.0, 0.0, distance_m);
          try_position(head, world_from_camera * Rigid3{rotation, centre - rotation * centre_in_board()});
        }
      }
    }
  }

  void try_position(std::size_t head, const Rigid3& world_from_board) {
    const std::array<Eigen::Vector2d, views_per_position> shares{Eigen::Vector2d{0.5, 0.5}, {0.15, 0.2}, {0.85, 0.8}};
    std::vector<HeadView> views;
    for (const Eigen::Vector2d& share : shares)
      if (auto view = view_at(head, world_from_board, share)) views.push_back(std::move(*view));
    if (views.size() == views_per_position) weigh(views, head, now_.boards.size(), world_from_board);
  }

  const RigCalibration& now_;
  const ViewConfig& config_;
  std::vector<Eigen::Vector3d> points_;
  RigProblem problem_;
  RigState state_;
  std::vector<double> weights_;
  std::optional<RigSystem> system_;
  Eigen::MatrixXd information_, sigma_rows_;
  ViewPlan plan_;
};

}  // namespace

FieldList fields_of(ViewConfig& config) {
  const auto angle = [](const char* name, double* value, const char* help, const char* option) {
    return Field{.name = name, .value = value, .help = help, .limits = {-360.0, 360.0}, .option = option};
  };
  FieldList fields{angle("min_pan_deg", &config.min_pan_deg, "Heads can look from this pan [deg]", "--min-pan-deg"),
                   angle("max_pan_deg", &config.max_pan_deg, "… to this", "--max-pan-deg"),
                   angle("min_tilt_deg", &config.min_tilt_deg, "Heads can look from this tilt [deg]", "--min-tilt-deg"),
                   angle("max_tilt_deg", &config.max_tilt_deg, "… to this", "--max-tilt-deg")};
  for (Field& field : board_reach_fields(config.min_range_m, config.max_range_m, "max_tilt_of_board_deg",
                                         config.max_tilt_of_board_deg))
    fields.push_back(std::move(field));
  return fields;
}

std::vector<std::string> faults(ViewConfig config) {
  std::vector<std::string> found = faults_of(fields_of(config));
  if (!(config.min_pan_deg < config.max_pan_deg)) found.emplace_back("min_pan_deg must be below max_pan_deg");
  if (!(config.min_tilt_deg < config.max_tilt_deg)) found.emplace_back("min_tilt_deg must be below max_tilt_deg");
  add_reach_fault(config.min_range_m, config.max_range_m, found);
  return found;
}

ViewPlan plan_view(const RigCalibration& now, const ViewConfig& config) {
  require_none(faults(config));
  if (now.status != RigReport::Status::converged || !now.config.board)
    throw ConfigError("there is no rig yet: its views did not converge");
  return ViewPlanner(now, config).planned();
}

}  // namespace alidade
