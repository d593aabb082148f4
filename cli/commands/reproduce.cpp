#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>

#include "alidade/reproduce/papers.h"
#include "alidade/results/documents/reproduce_document.h"
#include "cli/app/app.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

using reproduce::Claim;
using reproduce::Holds;
using reproduce::Paper;

struct ReproduceArgs {
  std::string paper;
  bool quick = false;
};

const char* symbol(Holds holds) { return holds == Holds::reproduced ? "●" : holds == Holds::in_shape ? "◆" : "▲"; }

std::string number_text(double value) { return std::isfinite(value) ? fmt::format("{:.4g}", value) : "–"; }

std::string line_of(const Claim& claim) {
  std::string text = fmt::format("{} {}:", symbol(claim.holds), claim.quantity);
  if (std::isfinite(claim.printed)) text += fmt::format(" printed {},", number_text(claim.printed));
  text += fmt::format(" the paper's method, re-run {}", number_text(claim.rerun));
  if (std::isfinite(claim.ours)) text += ", ours " + number_text(claim.ours);
  if (std::isfinite(claim.bound)) text += ", bound " + number_text(claim.bound);
  return claim.unit.empty() ? text : text + " " + claim.unit;
}

double clock_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

ExitCode reproduce_paper(const ReproduceArgs& args, Run& run) {
  reproduce::ReproduceConfig config;
  config.seed = run.options.seed;
  config.quick = args.quick;
  config.clock_s = clock_s;
  config.progress = run.progress;
  const auto all = reproduce::papers();
  const auto paper = std::ranges::find_if(all, [&](const Paper& each) { return args.paper == each.name; });
  const reproduce::PaperReport report = paper->run(config);
  run.lap("experiments");
  fill_reproduction(report, run.document);
  run.document.estimate["quick"] = args.quick;
  for (auto& [name, content] : reproduction_csvs(report)) run.add_file(name, std::move(content));
  run.say(report.reference);
  for (const reproduce::Experiment& experiment : report.experiments) {
    run.say(experiment.title);
    for (const Claim& claim : experiment.claims) run.say("  " + line_of(claim));
  }
  return run.finish(reproduce::reproduce_verdict(report));
}

}  // namespace

void add_reproduce(App& app) {
  auto args = std::make_shared<ReproduceArgs>();
  std::vector<std::string> names;
  std::string help = "Paper:";
  for (const Paper& paper : reproduce::papers()) {
    names.emplace_back(paper.name);
    help += fmt::format(" {} ({});", paper.name, paper.summary);
  }
  help.pop_back();
  CLI::App& command = app.add_command(
      {.name = "reproduce",
       .summary = "Rerun the experiments of a paper and compare its figures with ours and with our methods",
       .examples = "  alidade reproduce fang2011 --quick\n  alidade reproduce wang2020 --out wang --seed 7",
       .draws_random_numbers = true},
      [args](Run& run) { return reproduce_paper(*args, run); });
  command.add_option("paper", args->paper, help)->required()->check(CLI::IsMember(names));
  command.add_flag("--quick", args->quick, "Fewer random draws: half a minute instead of several minutes");
}

}  // namespace alidade::cli
