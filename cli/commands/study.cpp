#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <memory>

#include "alidade/estimation/config_error.h"
#include "alidade/results/documents/study_blocks.h"
#include "alidade/results/study_outcome.h"
#include "alidade/study/studies.h"
#include "cli/app/app.h"
#include "cli/commands/commands.h"
#include "cli/commands/shard_option.h"
#include "cli/commands/study_engine.h"

namespace alidade::cli {
namespace {

/// What every study has.
struct StudyOptions {
  std::uint64_t trials = 2000, block = 0;
  std::string shard, vary;
  std::optional<std::uint64_t> trial;
  bool resume = false;
};

template <typename Study>
struct StudyArgs {
  StudyOptions options;
  Study study;
};

template <typename Study>
StudyPlan plan_of(const StudyArgs<Study>& args, std::uint64_t seed) {
  StudyPlan plan;
  Study base = args.study;
  plan.header.study = Study::name;
  plan.header.seed = seed;
  plan.header.trials = args.options.trials;
  plan.header.settings = settings_of(fields_of(base));
  if (args.options.vary.empty()) {
    plan.points.push_back(setting_of(base, seed));
  } else {
    plan.header.variation = variation_from(args.options.vary);
    for (const double value : plan.header.variation->values) {
      Study varied = args.study;
      set_varied(fields_of(varied), plan.header.variation->name, value);
      plan.points.push_back(setting_of(varied, seed));
    }
  }
  plan.header.quantities = plan.points.front().quantities;
  plan.header.has_bound = plan.points.front().has_bound;
  return plan;
}

/// The blocks that an earlier run left, where it is gone on with; else none, and none is left of another study.
std::vector<StoredBlock> earlier_blocks(const StudyOptions& options, const StudyHeader& header, const Shard& shard,
                                        const std::filesystem::path& out) {
  if (!std::filesystem::is_directory(blocks_folder(out))) return {};
  if (!options.resume) {
    clear_blocks(out);
    return {};
  }
  std::vector<StoredBlock> blocks = read_blocks(out);
  std::vector<TrialBlock> places;
  for (const StoredBlock& stored : blocks) {
    const std::string difference = difference_of(stored.header, header);
    const std::string file = (blocks_folder(out) / block_file_name(stored.block)).string();
    if (!difference.empty()) throw InputError(file + ": is of another study: " + difference + "; give another --out");
    if (stored.shard != shard) {
      throw InputError(
          fmt::format("{}: is of shard {}/{}; give another --out", file, stored.shard.index, stored.shard.count));
    }
    places.push_back(stored.block);
  }
  if (const auto twice = overlap_of(places)) {
    throw InputError(fmt::format("{}: trial {} is in two blocks; remove one of them", blocks_folder(out).string(),
                                 twice->second.first));
  }
  return blocks;
}

/// Says what a stopped study leaves.
[[noreturn]] void stopped(std::size_t done, std::size_t of, const std::filesystem::path& out) {
  throw Interrupted(fmt::format("interrupted; {} of {} blocks are in {}: go on with --resume", done, of,
                                blocks_folder(out).string()));
}

void add_speed(std::uint64_t num_trials, double seconds, JobOutcome& outcome) {
  if (num_trials == 0) return;
  outcome.lines.push_back(fmt::format("{} trials in {:.3g} s: {:.3g} ms each", num_trials, seconds,
                                      1e3 * seconds / static_cast<double>(num_trials)));
}

ExitCode run_plan(const StudyPlan& plan, const StudyOptions& options, std::uint64_t block_size, Run& run) {
  const Shard shard = shard_from(options.shard);
  const std::filesystem::path& out = run.options.out;
  std::vector<StudyTally> points(plan.points.size(), StudyTally(plan.header.quantities.size()));
  const auto add = [&](const TrialBlock& block, const StudyTally& tally) {
    points[static_cast<std::size_t>(block.first / plan.header.trials)].add(tally);
  };
  std::vector<TrialBlock> done;
  const bool leaves_blocks = !run.options.keeps_outcome;
  std::vector<StoredBlock> earlier;
  if (leaves_blocks) earlier = earlier_blocks(options, plan.header, shard, out);
  for (const StoredBlock& stored : earlier) {
    done.push_back(stored.block);
    add(stored.block, stored.tally);
  }
  const auto blocks = blocks_missing(plan.header, shard.trials_of(plan.header), done, block_size);
  if (leaves_blocks) std::filesystem::create_directories(blocks_folder(out));
  run.lap("prepare");
  std::size_t num_done = 0;
  std::uint64_t num_trials = 0;
  try {
    study_engine().run(
        plan, blocks,
        [&](const TrialBlock& block, const StudyTally& tally) {
          if (leaves_blocks) write_block(out, {plan.header, shard, block, tally});
          add(block, tally);
          ++num_done;
          num_trials += tally.trials;
        },
        run.progress);
  } catch (const Interrupted&) {
    stopped(done.size() + num_done, done.size() + blocks.size(), out);
  }
  run.lap("trials");
  JobOutcome outcome = outcome_of(plan.header, points, shard);
  add_speed(num_trials, run.document.seconds.back().second, outcome);
  return run.finish(std::move(outcome));
}

/// One trial again, as the estimator's own command leaves it.
template <typename Study>
ExitCode run_trial(const StudyArgs<Study>& args, Run& run) {
  const StudyOptions& options = args.options;
  if (*options.trial >= options.trials) {
    throw UsageError(
        fmt::format("--trial: {} is none of the {} trials, which count from 0", *options.trial, options.trials));
  }
  if (!options.shard.empty()) throw UsageError("--trial: one trial has no shards; leave --shard out");
  if (!options.vary.empty()) throw UsageError("--trial: set the varied setting to its value, without --vary");
  run.document.command = Study::name;
  JobOutcome outcome = trial_outcome(args.study, run.options.seed, *options.trial);
  outcome.lines.insert(outcome.lines.begin(), fmt::format("trial {} of a study of {}, seed {}", *options.trial,
                                                          Study::name, run.options.seed));
  run.lap("trial");
  return run.finish(std::move(outcome));
}

template <typename Study>
ExitCode run_study(const StudyArgs<Study>& args, Run& run) {
  (void)shard_from(args.options.shard);  // of wrong usage every rank finds out
  if (study_engine().serve) {
    if (!args.options.trial) study_engine().serve(plan_of(args, run.options.seed));
    return ExitCode::ok;
  }
  if (args.options.trial) return run_trial(args, run);
  const std::uint64_t block = args.options.block > 0 ? args.options.block : Study::block;
  return run_plan(plan_of(args, run.options.seed), args.options, block, run);
}

void add_study_options(CLI::App& command, StudyOptions& options) {
  const std::string group = "Trials";
  command.add_option("--trials", options.trials, "Number of trials, for each value of --vary")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1000000000000}))
      ->type_name("N")
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--vary", options.vary,
                  "Vary a setting from one value to another in steps, for example photos=4:30:2")
      ->type_name("NAME=FROM:TO:STEP")
      ->group(group);
  command.add_option("--trial", options.trial, "Run only trial K (from 0), and write its report and inputs")
      ->type_name("K")
      ->group(group);
  command
      .add_option("--shard", options.shard,
                  "Run part I of N (from 0), for machines that do not share a job; see study merge")
      ->type_name("I/N")
      ->group(group);
  command.add_flag("--resume", options.resume, "Continue from the blocks in DIR/blocks")->group(group);
  command
      .add_option("--block", options.block,
                  "Maximum trials per block, which a killed run loses (0: the study's default)")
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{1000000000}))
      ->type_name("N")
      ->capture_default_str()
      ->group(group);
}

template <typename Study>
void add_one_study(App& app, const std::string& summary, const std::string& examples) {
  auto args = std::make_shared<StudyArgs<Study>>();
  CLI::App& command = app.add_command({.name = std::string("study ") + Study::name,
                                       .summary = summary,
                                       .examples = examples,
                                       .draws_random_numbers = true},
                                      [args](Run& run) { return run_study(*args, run); });
  app.add_fields(command, fields_of(args->study));
  add_study_options(command, args->options);
}

struct MergeArgs {
  std::vector<std::filesystem::path> folders;
};

ExitCode merge_study(const MergeArgs& args, Run& run) {
  if (study_engine().serve) return ExitCode::ok;
  const MergedStudy merged = merge_blocks(args.folders);
  run.document.seed = merged.header.seed;
  run.lap("read");
  return run.finish(outcome_of(merged.header, merged.points));
}

void add_study_merge(App& app) {
  auto args = std::make_shared<MergeArgs>();
  CLI::App& command = app.add_command({.name = "study merge",
                                       .summary = "Merge the shards of a study",
                                       .examples = "  alidade study merge part-0 part-1 part-2 --out whole"},
                                      [args](Run& run) { return merge_study(*args, run); });
  command.add_option("folders", args->folders, "Result folders of --shard, one per shard")
      ->required()
      ->type_name("DIR");
}

}  // namespace

Shard shard_from(const std::string& text) {
  if (text.empty()) return {};
  Shard shard;
  const char* end = text.data() + text.size();
  const auto [slash, first] = std::from_chars(text.data(), end, shard.index);
  if (first == std::errc{} && slash != end && *slash == '/') {
    const auto [last, second] = std::from_chars(slash + 1, end, shard.count);
    constexpr int max_shards = 1000000;
    const bool fits = shard.count >= 1 && shard.count <= max_shards && shard.index >= 0 && shard.index < shard.count;
    if (second == std::errc{} && last == end && fits) return shard;
  }
  throw UsageError("--shard: '" + text + "' is not I/N with I from 0 to N - 1, as 3/8");
}

StudyEngine& study_engine() {
  static StudyEngine engine;
  return engine;
}

void add_study(App& app) {
  app.add_group(
      "study",
      "Monte Carlo studies on simulated data: bias, error relative to the Cramér–Rao bound, and coverage of σ");
  add_one_study<ObserveStudy>(app, "Intrinsics of a rotating camera (observe)",
                              "  alidade study observe --trials 1000000 --out far\n"
                              "  alidade study observe --trials 2000 --method hybrid --vary rows=60:240:60\n"
                              "  alidade study observe --trials 1000000 --trial 48211 --out one\n"
                              "  mpirun -n 8 alidade-study observe --trials 100000000 --out far");
  add_one_study<CalibrateStudy>(app, "Calibration from photos of a board (calibrate)",
                                "  alidade study calibrate --trials 2400 --photos 12 --noise 0.1\n"
                                "  alidade study calibrate --trials 500 --vary photos=4:30:2 --out curve\n"
                                "  alidade study calibrate --trials 100000 --shard 3/8 --out part-3");
  add_one_study<RangefinderStudy>(app, "Laser rangefinder beside a camera (rangefinder)",
                                  "  alidade study rangefinder --trials 2000\n"
                                  "  alidade study rangefinder --trials 500 --vary shots=6:30:4");
  add_one_study<TrackStudy>(app, "Target tracked by two heads (track)",
                            "  alidade study track --trials 1000 --scenario B");
  add_one_study<LocalizeStudy>(app, "Camera localised under water (localize)", "  alidade study localize --trials 200");
  add_one_study<TurnedStudy>(app, "Intrinsics from photos of a camera rotated by hand",
                             "  alidade study turned --trials 200 --on-the-spot --wrong-matches 0.3\n"
                             "  alidade study turned --trials 200 --vary lever=0:0.2:0.05");
  add_one_study<ChainStudy>(app, "Whole chain: photos, lenses, rig of two heads, tracked target",
                            "  alidade study chain --trials 200 --vary range=1:13:4\n"
                            "  alidade study chain --trials 200 --range 6 --exact");
  add_study_merge(app);
}

}  // namespace alidade::cli
