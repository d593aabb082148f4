#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <fstream>
#include <map>
#include <memory>

#include "alidade/results/fleet_text.h"
#include "cli/app/app.h"
#include "cli/app/child_process.h"
#include "cli/app/image_size.h"
#include "cli/app/terminal.h"
#include "cli/commands/commands.h"
#include "cli/commands/fleet_engine.h"

namespace alidade::cli {
namespace {

/// This process becomes `alidade-fleet`, with the same words.
[[noreturn]] void hand_over(const Run& run) {
  if (run.options.keeps_outcome) throw UsageError("a worker runs until it is stopped: run it as a command");
  std::error_code error;
  const std::filesystem::path program = own_executable().parent_path() / "alidade-fleet";
  if (!std::filesystem::is_regular_file(program, error)) {
    throw InputError(program.string() +
                     ": is not there; this program runs fleets, and is installed beside alidade where that is built "
                     "with libnats (Debian: libnats-dev)");
  }
  std::vector<std::string> words = run.document.argv;
  words.front() = program.string();
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  give_back_stderr();
  ::execv(program.c_str(), argv.data());
  throw InputError(program.string() + ": cannot be started");
}

void add_broker_options(CLI::App& command, FleetBroker& broker) {
  const std::string group = "Broker";
  command.add_option("--nats", broker.url, "Address of a NATS server with JetStream")
      ->type_name("URL")
      ->capture_default_str()
      ->group(group);
  command.add_option("--creds", broker.credentials, "User credentials (JWT and seed)")->type_name("FILE")->group(group);
  command.add_option("--tls-ca", broker.ca, "CA certificates to verify the server; enables TLS")
      ->type_name("FILE")
      ->group(group);
  CLI::Option* cert = command.add_option("--tls-cert", broker.certificate, "Client certificate")->type_name("FILE");
  CLI::Option* key = command.add_option("--tls-key", broker.key, "Key of the client certificate")->type_name("FILE");
  cert->needs(key)->group(group);
  key->needs(cert)->group(group);
}

struct WorkerArgs {
  FleetWorkerOptions options;
  std::string size, from;
};

struct FleetLine {
  std::size_t number = 0;
  std::string id, row;
};

/// Lines "CAMERA ROW" of a file, as simulate fleet leaves them.
std::vector<FleetLine> read_rows(const std::string& path) {
  std::ifstream in(path);
  if (!in) throw InputError(path + ": cannot be read");
  std::vector<FleetLine> rows;
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    const std::size_t space = line.find(' ');
    if (space == std::string::npos) throw InputError(fmt::format("{}:{}: is not 'CAMERA ROW'", path, number));
    rows.push_back({number, line.substr(0, space), line.substr(space + 1)});
  }
  if (rows.empty()) throw InputError(path + ": holds no rows");
  return rows;
}

/// The cameras of a file, and what came of its rows.
struct OfflineFleet {
  std::map<std::string, FleetCamera> cameras;
  std::map<std::string, FleetNumbers> numbers;
  std::string alarms;
  std::size_t num_alarms = 0;
  Counts counts;
};

/// Of rows that say nothing, or not all they should, the first ones are named.
void note_fault(const std::string& path, const FleetLine& line, FleetFault fault, Counts& counts) {
  constexpr std::size_t most_named = 20;
  counts.dropped += says_nothing(fault) ? 1 : 0;
  if (counts.skipped.size() < most_named)
    counts.skipped.push_back({path, line.number, line.id + ": " + sentence_of(fault)});
}

OfflineFleet through_one_worker(const std::vector<FleetLine>& lines, const WorkerArgs& args, const Progress& progress) {
  OfflineFleet fleet;
  std::string fault;
  for (const FleetLine& line : lines) {
    if (fleet.counts.given % 1024 == 0) report_progress(progress, "rows", fleet.counts.given, lines.size());
    const auto row = parse_fleet_row(line.row, fault);
    FleetCamera& camera = fleet.cameras[line.id];
    if (!row || row->n != camera.n + 1)
      throw InputError(
          fmt::format("{}:{}: a row of {}: {}", args.from, line.number, line.id, row ? "n is not the next" : fault));
    note_time(*row, fleet.numbers[line.id]);
    ++fleet.counts.given;
    if (const auto alarm = advance(camera, *row, args.options.config)) {
      fleet.alarms += fleet_alarm_text(line.id, *alarm) + "\n";
      ++fleet.num_alarms;
    }
    if (camera.last_fault != FleetFault::none) note_fault(args.from, line, camera.last_fault, fleet.counts);
  }
  fleet.counts.used = fleet.counts.given - fleet.counts.dropped;
  return fleet;
}

/// What is said of a camera, if that is more than that it is well or has changed.
std::string complaint_of(const FleetCamera& camera, const FleetNumbers& numbers) {
  const Verdict verdict = verdict_of(camera);
  const std::string order = sentence_of(numbers);
  const bool is_well = verdict.ok() && camera.last_fault == FleetFault::none && camera.off_centre_percent == 0;
  if (is_well) return order;
  return verdict.sentence + (order.empty() ? "" : "; " + order);
}

/// Rows that say nothing are told; the first camera that knows nothing, or of which something is to be told, is named.
Verdict offline_verdict(const OfflineFleet& fleet, double rows_per_s) {
  const std::size_t num = fleet.cameras.size();
  Verdict verdict;
  verdict.sentence =
      fmt::format("{} rows of {} camera{}, {} alarms; {:.0f} rows a second, {} bytes a camera", fleet.counts.given, num,
                  num == 1 ? "" : "s", fleet.num_alarms, rows_per_s, sizeof(FleetCamera));
  if (fleet.counts.dropped > 0) verdict.sentence += fmt::format("; {} rows say nothing", fleet.counts.dropped);
  std::vector<std::string> faulty;
  std::size_t num_refused = 0;
  for (const auto& [id, camera] : fleet.cameras) {
    num_refused += estimate_of(camera).has_value ? 0 : 1;
    const std::string complaint = complaint_of(camera, fleet.numbers.at(id));
    if (!complaint.empty()) faulty.push_back(id + ": " + complaint);
  }
  if (faulty.empty()) return verdict;
  verdict.state = State::care;
  verdict.sentence += "; " + faulty.front();
  if (faulty.size() > 1) verdict.sentence += fmt::format(", and {} more cameras", faulty.size() - 1);
  verdict.to_add = fleet.counts.dropped > 0
                       ? "send t, the rotation and the points of every row as numbers: states.jsonl names the cameras"
                       : "see to these cameras: states.jsonl says of each what it is";
  if (num_refused == num) {
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::undetermined;
  }
  return verdict;
}

/// The rows of a file through one worker, without a broker.
ExitCode work_offline(const WorkerArgs& args, Run& run) {
  const auto lines = read_rows(args.from);
  run.lap("read");
  OfflineFleet fleet = through_one_worker(lines, args, run.progress);
  run.lap("rows");
  const double rate = static_cast<double>(lines.size()) / run.document.seconds.back().second;
  std::string states;
  for (const auto& [id, camera] : fleet.cameras) states += fleet_state_text(id, camera, fleet.numbers.at(id)) + "\n";
  run.add_file("states.jsonl", std::move(states));
  run.add_file("alarms.jsonl", std::move(fleet.alarms));
  run.document.estimate["rows"] = lines.size();
  run.document.estimate["cameras"] = fleet.cameras.size();
  run.document.estimate["alarms"] = fleet.num_alarms;
  run.document.estimate["rows_per_s"] = rate;
  run.document.estimate["bytes_a_camera"] = sizeof(FleetCamera);
  run.document.counts = fleet.counts;
  return run.finish(offline_verdict(fleet, rate));
}

ExitCode fleet_worker(WorkerArgs& args, Run& run) {
  std::tie(args.options.config.width_px, args.options.config.height_px) = image_size(args.size);
  if (!args.from.empty()) return work_offline(args, run);
  if (!fleet_engine().work) hand_over(run);
  return fleet_engine().work(args.options, run);
}

struct FleetSimulationArgs {
  FleetSimulation simulation;
  std::string size = "640x480";
  bool publishes = false, as_fast = false;
};

/// The truth of every camera.
std::string truth_csv(const FleetSimulation& simulation) {
  std::string text = "camera,fx,fy,cx,cy,event,event_t_s,event_size,focal_per_c\n";
  for (int i = 0; i < simulation.cameras; ++i) {
    const FleetScene scene = draw_fleet_scene(simulation.scene, simulation.seed, i);
    text += fmt::format("{},{},{},{},{},{},{},{},{}\n", scene.id, scene.fx, scene.fy, scene.cx, scene.cy,
                        event_word(scene.event), scene.event_t_s, scene.event_size, scene.focal_per_c);
  }
  return text;
}

std::string rows_text(const FleetSimulation& simulation, const Progress& progress) {
  std::vector<FleetScene> scenes;
  for (int i = 0; i < simulation.cameras; ++i) scenes.push_back(draw_fleet_scene(simulation.scene, simulation.seed, i));
  std::string text;
  for (int n = 1; n <= simulation.rows; ++n) {
    report_progress(progress, "rows", static_cast<std::size_t>(n), static_cast<std::size_t>(simulation.rows));
    for (const FleetScene& scene : scenes) {
      const FleetObservation observation = simulate_observation(scene, simulation.scene, simulation.seed, n);
      text += scene.id + " " + fleet_row_text(fleet_row_of(observation, n)) + "\n";
    }
  }
  return text;
}

ExitCode simulate_fleet(FleetSimulationArgs& args, Run& run) {
  FleetSimulation& simulation = args.simulation;
  std::tie(simulation.scene.width_px, simulation.scene.height_px) = image_size(args.size);
  simulation.seed = run.options.seed;
  simulation.is_real_time = !args.as_fast;
  if (args.publishes && !fleet_engine().publish) hand_over(run);
  run.add_file("truth.csv", truth_csv(simulation));
  if (args.publishes) return fleet_engine().publish(simulation, run);
  run.add_file("rows.txt", rows_text(simulation, run.progress));
  const auto rows = static_cast<std::size_t>(simulation.cameras) * static_cast<std::size_t>(simulation.rows);
  run.document.estimate["rows"] = rows;
  run.document.counts.given = run.document.counts.used = rows;
  Verdict verdict;
  verdict.sentence = fmt::format("{} rows of {} cameras with known truth", rows, simulation.cameras);
  run.say(fmt::format("{} in {}", verdict.sentence, run.options.out.string()));
  return run.finish(verdict);
}

void add_worker(App& app) {
  auto args = std::make_shared<WorkerArgs>();
  CLI::App& command = app.add_command(
      {.name = "fleet worker",
       .summary =
           "Process observations of installed cameras as they arrive, keep the state of each, and report what moves",
       .examples = "  nats-server -a 127.0.0.1 -js -sd store &\n"
                   "  alidade fleet worker --nats nats://127.0.0.1:4222 --size 640x480\n"
                   "  alidade fleet worker --from fleet/rows.txt --size 640x480 --out states",
       .leaves_results = false},
      [args](Run& run) { return fleet_worker(*args, run); });
  command.add_option("--size", args->size, "Image size")->required()->type_name("WxH");
  command
      .add_option("--threshold", args->options.config.threshold,
                  "Alarm threshold of the cumulative sums (CUSUM), in σ; see docs/scale.md")
      ->check(CLI::Range(3.0, 100.0))
      ->capture_default_str();
  command
      .add_option("--from", args->from,
                  "Read rows from a file instead, lines 'CAMERA ROW'; writes states.jsonl, alarms.jsonl")
      ->type_name("FILE");
  add_broker_options(command, args->options.broker);
}

void add_watch(App& app) {
  auto args = std::make_shared<FleetWatchOptions>();
  CLI::App& command =
      app.add_command({.name = "fleet watch",
                       .summary = "Show the fleet in a browser: verdicts, worst first, and the history of each camera",
                       .examples = "  alidade fleet watch --nats nats://127.0.0.1:4222",
                       .leaves_results = false},
                      [args](Run& run) -> ExitCode {
                        if (!fleet_engine().watch) hand_over(run);
                        return fleet_engine().watch(*args, run);
                      });
  command.add_option("--port", args->port, "Port of the web page, on localhost only; 0: any free port")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  add_broker_options(command, args->broker);
}

}  // namespace

FleetEngine& fleet_engine() {
  static FleetEngine engine;
  return engine;
}

void add_fleet(App& app) {
  app.add_group("fleet", "Monitor installed cameras continuously over a NATS broker");
  add_worker(app);
  add_watch(app);
}

void add_fleet_scenario(App& app) {
  auto args = std::make_shared<FleetSimulationArgs>();
  CLI::App& command = app.add_command(
      {.name = "simulate fleet",
       .summary = "Fleet of patrolling cameras with faults: slipping belts, sagging brackets, drifting focal lengths, "
                  "frozen images",
       .examples =
           "  alidade simulate fleet --cameras 100 --rows 600 --out fleet\n"
           "  alidade simulate fleet --cameras 10000 --rate 1 --publish --nats nats://127.0.0.1:4222 --out fleet",
       .draws_random_numbers = true},
      [args](Run& run) { return simulate_fleet(*args, run); });
  FleetSimulation& simulation = args->simulation;
  const auto number = [&](const char* name, double& value, const char* help, double low, double high) {
    command.add_option(name, value, help)->check(CLI::Range(low, high))->capture_default_str();
  };
  command.add_option("--cameras", simulation.cameras, "Number of cameras")
      ->check(CLI::Range(1, 99999))
      ->capture_default_str();
  command.add_option("--rows", simulation.rows, "Rows per camera")
      ->check(CLI::Range(1, 10000000))
      ->capture_default_str();
  command.add_option("--size", args->size, "Image size")->type_name("WxH")->capture_default_str();
  number("--rate", simulation.scene.rate_hz, "Rows per second per camera", 0.001, 1000.0);
  number("--noise-px", simulation.scene.noise_px, "σ of a pixel coordinate [px]", 0.0, 100.0);
  number("--events", simulation.scene.event_share, "Share of the cameras that have a fault", 0.0, 1.0);
  number("--event-after", simulation.scene.event_after_s, "Faults occur between this time and twice this time [s]", 0.0,
         1e9);
  number("--slip-sigmas", simulation.scene.slip_sigmas,
         "The only fault is a slipping belt, by this many σ of a row; 0: random faults", 0.0, 1000.0);
  number(
      "--warming", simulation.scene.warming_c,
      "Temperature rise instead of faults; the focal length of the --events share of cameras follows it [°C]; 0: none",
      0.0, 100.0);
  number("--warming-time", simulation.scene.warming_s, "Duration of the temperature rise [s]", 1.0, 1e9);
  command.add_flag("--publish", args->publishes, "Publish the rows instead of writing rows.txt");
  command.add_flag("--fast", args->as_fast, "Publish as fast as the broker accepts, instead of at --rate");
  add_broker_options(command, simulation.broker);
}

}  // namespace alidade::cli
