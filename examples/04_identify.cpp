// How an axis of a pan-tilt head follows its command, from a log of commands and angles: 04_identify log.csv [folder]
#include <alidade/files.h>
#include <alidade/identify.h>

#include <cmath>
#include <cstdio>

int main(int argc, char** argv) {
  if (argc < 2) return std::puts("usage: 04_identify LOG.csv [FOLDER]"), 2;
  const auto result = alidade::identify(alidade::read_servo_log(argv[1]).samples);
  std::puts(result.verdict.sentence.c_str());
  if (!result.verdict.ok()) return 1;
  for (int i = 0; i < alidade::num_servo_params; ++i)
    std::printf("%-10s %10.5g ± %.2g\n", alidade::servo_param_names[static_cast<std::size_t>(i)], result.fit.params[i],
                3.0 * std::sqrt(result.fit.cov(i, i)));
  for (const std::size_t flaw : result.fit.freed) std::printf("has %s\n", alidade::servo_flaw_words[flaw]);
  if (argc > 2) alidade::save(alidade::outcome_of(result), argv[2]);
}
