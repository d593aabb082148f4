#include "alidade/results/documents/heads_document.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>

#include "alidade/pantilt/rig.h"

namespace alidade {
namespace {

TEST(HeadsDocument, SigmaOfABaseIsAlongTheAxesOfTheWorld) {
  Rig rig;
  rig.heads.emplace_back();
  rig.heads[0].head.world_from_base.rotation =
      Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitY());  // the base's x is −z of the world
  rig.cov.setZero(num_head_params, num_head_params);
  rig.cov(0, 0) = 4e-6;
  rig.cov(1, 1) = 1e-6;
  const Eigen::Vector3d sigma_m = sigma_of_base(rig, rig.cov, 0);
  EXPECT_NEAR(sigma_m.x(), 0.0, 1e-9);
  EXPECT_NEAR(sigma_m.y(), 1e-3, 1e-9);
  EXPECT_NEAR(sigma_m.z(), 2e-3, 1e-9);
}

}  // namespace
}  // namespace alidade
