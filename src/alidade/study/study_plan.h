#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "alidade/description/field.h"
#include "alidade/estimation/progress.h"
#include "alidade/study/tally.h"

namespace alidade {

/// A setting that a study varies: "photos=4:30:2", from 4 to 30 by 2.
struct StudyVariation {
  std::string name;
  std::vector<double> values;

  bool operator==(const StudyVariation&) const = default;
};

/// The definition of a study, independent of machines and shards: everything that its result depends on.
struct StudyHeader {
  std::string study;  ///< observe, calibrate, …
  std::uint64_t seed = 1;
  std::uint64_t trials = 0;                                   ///< Of each value that is varied.
  std::vector<std::pair<std::string, std::string>> settings;  ///< By name, as typed.
  std::optional<StudyVariation> variation;
  std::vector<TrialQuantity> quantities;
  bool has_bound = false;

  [[nodiscard]] std::size_t num_points() const { return variation ? variation->values.size() : 1; }
  [[nodiscard]] std::uint64_t num_trials() const { return trials * num_points(); }
  bool operator==(const StudyHeader&) const = default;
};

/// Trials in a row, of one point: numbers first … end − 1 of trial + point · trials.
struct TrialBlock {
  std::uint64_t first = 0, end = 0;

  bool operator==(const TrialBlock&) const = default;
};

/// Shard `index` of `count`, from 0: its trials, as even as can be.
struct Shard {
  int index = 0, count = 1;

  [[nodiscard]] TrialBlock trials_of(const StudyHeader& header) const;
  bool operator==(const Shard&) const = default;
};

/// A study that can be run: its header, and the setting of each point.
struct StudyPlan {
  StudyHeader header;
  std::vector<StudySetting> points;
};

/// What of `wanted` no block of `done` holds, in blocks of at most `size` trials of one point.
[[nodiscard]] std::vector<TrialBlock> blocks_missing(const StudyHeader& header, const TrialBlock& wanted,
                                                     std::vector<TrialBlock> done, std::uint64_t size);

/// Two blocks that hold the same trial, if there are such.
[[nodiscard]] std::optional<std::pair<TrialBlock, TrialBlock>> overlap_of(std::vector<TrialBlock> blocks);

/// "photos=4:30:2". What is wrong with it is thrown as ConfigError.
[[nodiscard]] StudyVariation variation_from(const std::string& text);
/// Sets the field that a variation names, by its name or option. Throws ConfigError where there is none, or it does not
/// take the value.
void set_varied(const FieldList& fields, const std::string& name, double value);
/// The fields as a header holds them.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> settings_of(const FieldList& fields);

/// A worker for the blocks of a plan, for one thread at a time.
class BlockWorker {
 public:
  explicit BlockWorker(const StudyPlan& plan) : plan_(plan), workers_(plan.points.size()) {}

  /// `progress` is asked after each trial, with what was done in this block.
  [[nodiscard]] StudyTally run(const TrialBlock& block, const Progress& progress = {});

 private:
  const StudyPlan& plan_;
  std::vector<RunTrial> workers_;
  TrialResult result_;
};

using BlockDone = std::function<void(const TrialBlock& block, const StudyTally& tally)>;
/// Runs blocks by as many threads as there may be, each with no threads of its own; `done` is called by one at a time.
/// Throws Interrupted where `progress` says stop: the blocks that were done are.
void run_blocks(const StudyPlan& plan, const std::vector<TrialBlock>& blocks, const BlockDone& done,
                const Progress& progress);

}  // namespace alidade
