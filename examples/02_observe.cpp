// Intrinsics of a rotating camera, row by row and at the end: 02_observe LOG.csv WIDTH HEIGHT RESULT
#include <alidade/files.h>
#include <alidade/observe.h>

#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
  if (argc != 5) return std::puts("usage: 02_observe LOG.csv WIDTH HEIGHT RESULT"), 2;
  const alidade::RotationLog log = alidade::read_rotation_log(argv[1]).log;
  const alidade::ObserveConfig config{.width_px = std::atoi(argv[2]), .height_px = std::atoi(argv[3])};

  // As rows arrive: from a file here, from a head that rotates elsewhere.
  alidade::RotationLog layout = log;
  layout.rows.clear();
  layout.truth.clear();
  alidade::Observer observer(layout, config);
  for (const alidade::RotationRow& row : log.rows) {
    const alidade::ObserveStep step = observer.push(row);
    if (step.estimate.event == alidade::ObserveEvent::none) continue;
    const std::string event(alidade::event_name(step.estimate.event));
    std::printf("%8.3f s  %-8s fx %.2f\n", step.t_s, event.c_str(), step.estimate.fx);
  }

  // The same report as observer.finish() where the log has no truth, of the whole log.
  const alidade::ObserveReport result = alidade::observe(log, config);
  std::puts(result.verdict.sentence.c_str());
  for (const alidade::ObservedQuantity& quantity : result.quantities)
    std::printf("%-4s %12.6g ± %.2g\n", quantity.name.c_str(), quantity.value, 3.0 * quantity.sigma);
  alidade::save(alidade::outcome_of(result), argv[4]);
  return result.verdict.ok() ? 0 : 1;
}
