#include "alidade/fleet/fleet_parts.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <functional>

namespace alidade {
namespace {

/// Names as they are given, numbered in one way or another, over the parts as chance would have them: χ² of 31 degrees
/// of freedom is within 7 and 82 but once in 10⁶ on each side.
TEST(FleetParts, NamesSpreadAsByChance) {
  const std::array<std::function<std::string(int)>, 9> kinds{
      [](int i) { return fmt::format("c{:05}", i); },
      [](int i) { return fmt::format("cam{}", i); },
      [](int i) { return fmt::format("{}", i); },
      [](int i) { return fmt::format("cam-north-{}", i); },
      [](int i) { return fmt::format("hall{}-line{}-cam{}", i / 64, i / 8 % 8, i % 8); },
      [](int i) { return fmt::format("10_0_{}_{}", i / 250, i % 250); },
      [](int i) { return fmt::format("00:1a:2b:3c:{:02x}:{:02x}", i / 256, i % 256); },
      [](int i) { return fmt::format("{:04}_entrance", i); },
      [](int i) { return fmt::format("{:08x}-0000-4000-8000-000000000000", i); }};
  for (const auto& name : kinds) {
    for (const int cameras : {200, 1000, 10000}) {
      std::array<int, num_fleet_parts> counts{};
      for (int i = 1; i <= cameras; ++i) ++counts.at(static_cast<std::size_t>(fleet_part_of(name(i))));
      const double expected = static_cast<double>(cameras) / num_fleet_parts;
      double chi2 = 0.0;
      for (const int count : counts) chi2 += (count - expected) * (count - expected) / expected;
      EXPECT_GT(chi2, 7.0) << name(1) << " … " << name(cameras);
      EXPECT_LT(chi2, 82.0) << name(1) << " … " << name(cameras);
    }
  }
}

}  // namespace
}  // namespace alidade
