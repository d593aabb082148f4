#include "alidade/study/study_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "alidade/estimation/config_error.h"

namespace alidade {
namespace {

constexpr std::size_t max_points = 1000;

std::optional<double> varied_number(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

[[noreturn]] void refuse_variation(const std::string& text, const std::string& why) {
  throw ConfigError("--vary: '" + text + "' " + why);
}

void sort_blocks(std::vector<TrialBlock>& blocks) {
  std::ranges::sort(blocks, [](const TrialBlock& a, const TrialBlock& b) {
    return std::pair(a.first, a.end) < std::pair(b.first, b.end);
  });
}

}  // namespace

TrialBlock Shard::trials_of(const StudyHeader& header) const {
  // 128 bits: trials times shards may be more than 64 hold.
  __extension__ typedef unsigned __int128 Wide;
  const auto cut = [&](int i) {
    return static_cast<std::uint64_t>(static_cast<Wide>(header.num_trials()) * static_cast<Wide>(i) /
                                      static_cast<Wide>(count));
  };
  return {cut(index), cut(index + 1)};
}

std::vector<TrialBlock> blocks_missing(const StudyHeader& header, const TrialBlock& wanted,
                                       std::vector<TrialBlock> done, std::uint64_t size) {
  sort_blocks(done);
  std::vector<TrialBlock> missing;
  const auto cut = [&](std::uint64_t from, std::uint64_t until) {
    while (from < until) {
      const std::uint64_t point_end = (from / header.trials + 1) * header.trials;
      // From multiples of the size on, so that a resumed study has the blocks that it would have had.
      const std::uint64_t in_point = from % header.trials;
      const std::uint64_t block_end = from - in_point + (in_point / size + 1) * size;
      const std::uint64_t end = std::min({until, point_end, block_end});
      missing.push_back({from, end});
      from = end;
    }
  };
  std::uint64_t at = wanted.first;
  for (const TrialBlock& block : done) {
    if (block.end <= at || block.first >= wanted.end) continue;
    if (block.first > at) cut(at, block.first);
    at = block.end;
  }
  cut(at, wanted.end);
  return missing;
}

std::optional<std::pair<TrialBlock, TrialBlock>> overlap_of(std::vector<TrialBlock> blocks) {
  sort_blocks(blocks);
  for (std::size_t i = 1; i < blocks.size(); ++i) {
    if (blocks[i].first < blocks[i - 1].end) return std::pair(blocks[i - 1], blocks[i]);
  }
  return std::nullopt;
}

StudyVariation variation_from(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0) refuse_variation(text, "is not NAME=FROM:TO:STEP, as photos=4:30:2");
  std::vector<double> numbers;
  std::string_view rest = std::string_view(text).substr(equals + 1);
  while (true) {
    const std::size_t colon = rest.find(':');
    const auto number = varied_number(rest.substr(0, colon));
    if (!number) refuse_variation(text, "is not NAME=FROM:TO:STEP, as photos=4:30:2");
    numbers.push_back(*number);
    if (colon == std::string_view::npos) break;
    rest.remove_prefix(colon + 1);
  }
  if (numbers.size() != 3) refuse_variation(text, "is not NAME=FROM:TO:STEP, as photos=4:30:2");
  const double from = numbers[0], to = numbers[1], step = numbers[2];
  if (!(step > 0.0) || !(to >= from)) refuse_variation(text, "does not go up from FROM to TO by a STEP above 0");
  const double count = std::floor((to - from) / step + 1e-9) + 1.0;
  if (!(count <= static_cast<double>(max_points))) refuse_variation(text, "has more than 1000 values");
  StudyVariation variation{text.substr(0, equals), {}};
  for (double i = 0.0; i < count; ++i) {
    // Twelve digits: 0.1 + 2 · 0.1 is 0.3.
    variation.values.push_back(varied_number(fmt::format("{:.12g}", from + i * step)).value_or(from));
  }
  return variation;
}

void set_varied(const FieldList& fields, const std::string& name, double value) {
  std::string option = "--" + name;
  std::ranges::replace(option, '_', '-');
  for (const Field& field : fields) {
    if (field.name != name && option_of(field) != option) continue;
    const std::string fault = set_field(field, fmt::format("{}", value));
    if (!fault.empty()) throw ConfigError("--vary " + name + ": " + fault);
    return;
  }
  std::string known;
  for (const Field& field : fields) known += (known.empty() ? "" : ", ") + option_of(field).substr(2);
  throw ConfigError("--vary: '" + name + "' is none of " + known);
}

std::vector<std::pair<std::string, std::string>> settings_of(const FieldList& fields) {
  std::vector<std::pair<std::string, std::string>> settings;
  for (const Field& field : fields) settings.emplace_back(field.name, value_text(field));
  return settings;
}

}  // namespace alidade
