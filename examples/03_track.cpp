// The path of a target from the observations of two pan-tilt heads, one by one: 03_track events.csv rig.yaml
#include <alidade/files.h>
#include <alidade/track.h>

#include <cmath>
#include <cstdio>

int main(int argc, char** argv) {
  if (argc < 3) return std::puts("usage: 03_track EVENTS.csv RIG.yaml [FOLDER]"), 2;
  const alidade::Rig rig = alidade::read_rig(argv[2]);
  alidade::TargetTracker tracker(rig, {.sigma_a_m_s2 = 1.0, .sigma_px = 0.5});
  for (const auto& observation : alidade::read_events(argv[1], rig.heads).observations) {
    const alidade::TrackStep step = tracker.push(observation);
    if (step.event == alidade::TrackEvent::start) std::printf("the track starts at %.2f s\n", step.t_s);
  }
  const auto result = tracker.finish();
  std::puts(result.verdict.sentence.c_str());
  if (!result.verdict.ok()) return 1;
  const auto& last = result.steps.back();
  for (int i = 0; i < 3; ++i)
    std::printf("%c %8.4f ± %.2g m\n", "xyz"[i], last.belief.x[i], 3.0 * std::sqrt(last.belief.P(i, i)));
  if (argc > 3) alidade::save(alidade::outcome_of(result), argv[3]);
}
