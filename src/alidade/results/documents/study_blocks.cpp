#include "alidade/results/documents/study_blocks.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "alidade/files/files.h"

namespace alidade {
namespace {

using nlohmann::ordered_json;

constexpr const char* block_schema = "alidade-study-block/2";

ordered_json header_json(const StudyHeader& header) {
  ordered_json json;
  json["study"] = header.study;
  json["seed"] = header.seed;
  json["trials"] = header.trials;
  json["settings"] = ordered_json::array();
  for (const auto& [name, value] : header.settings) json["settings"].push_back({name, value});
  if (header.variation) json["vary"] = {{"name", header.variation->name}, {"values", header.variation->values}};
  json["quantities"] = ordered_json::array();
  for (const TrialQuantity& quantity : header.quantities) json["quantities"].push_back({quantity.name, quantity.unit});
  json["has_bound"] = header.has_bound;
  return json;
}

StudyHeader header_of(const ordered_json& json) {
  StudyHeader header;
  header.study = json.at("study").get<std::string>();
  header.seed = json.at("seed").get<std::uint64_t>();
  header.trials = json.at("trials").get<std::uint64_t>();
  for (const auto& each : json.at("settings"))
    header.settings.emplace_back(each.at(0).get<std::string>(), each.at(1).get<std::string>());
  if (json.contains("vary")) {
    header.variation.emplace();
    header.variation->name = json.at("vary").at("name").get<std::string>();
    header.variation->values = json.at("vary").at("values").get<std::vector<double>>();
  }
  for (const auto& each : json.at("quantities"))
    header.quantities.push_back({each.at(0).get<std::string>(), each.at(1).get<std::string>()});
  header.has_bound = json.at("has_bound").get<bool>();
  return header;
}

ordered_json tally_json(const StudyTally& tally) {
  ordered_json json;
  json["trials"] = tally.trials;
  json["estimates"] = tally.estimates;
  json["beyond"] = tally.beyond;
  json["good_beyond_5_sigma"] = tally.good_beyond_5_sigma;
  json["states"] = tally.states;
  json["quantities"] = ordered_json::array();
  for (const QuantityTally& sums : tally.quantities)
    json["quantities"].push_back({{"values", sums.values},
                                  {"error", sums.error.text()},
                                  {"error2", sums.error2.text()},
                                  {"sigma2", sums.sigma2.text()},
                                  {"ratio2", sums.ratio2.text()},
                                  {"inside", sums.inside},
                                  {"sizes", std::vector(sums.sizes.begin(), sums.sizes.end())}});
  json["worst"] = ordered_json::array();
  for (const WorstTrial& worst : tally.worst)
    json["worst"].push_back({worst.trial, worst.quantity, worst.error, worst.sigma});
  return json;
}

ExactSum sum_of(const ordered_json& json) {
  const auto sum = ExactSum::from_text(json.get<std::string>());
  if (!sum) throw std::invalid_argument("a sum is no whole number");
  return *sum;
}

std::map<int, std::uint64_t> sizes_of(const ordered_json& json) {
  std::map<int, std::uint64_t> sizes;
  for (const auto& each : json) sizes[each.at(0).get<int>()] = each.at(1).get<std::uint64_t>();
  return sizes;
}

StudyTally tally_of(const ordered_json& json) {
  StudyTally tally;
  tally.trials = json.at("trials").get<std::uint64_t>();
  tally.estimates = json.at("estimates").get<std::uint64_t>();
  tally.beyond = json.at("beyond").get<std::uint64_t>();
  tally.good_beyond_5_sigma = json.at("good_beyond_5_sigma").get<std::uint64_t>();
  tally.states = json.at("states").get<std::array<std::uint64_t, 5>>();
  for (const auto& each : json.at("quantities"))
    tally.quantities.push_back({each.at("values").get<std::uint64_t>(), sum_of(each.at("error")),
                                sum_of(each.at("error2")), sum_of(each.at("sigma2")), sum_of(each.at("ratio2")),
                                each.at("inside").get<std::array<std::uint64_t, 3>>(), sizes_of(each.at("sizes"))});
  for (const auto& each : json.at("worst"))
    tally.worst.push_back(
        {each.at(0).get<std::uint64_t>(), each.at(1).get<int>(), each.at(2).get<double>(), each.at(3).get<double>()});
  return tally;
}

/// What does not fit together in a block that could be read.
void require_whole(const StoredBlock& stored) {
  const StudyHeader& header = stored.header;
  const Shard& shard = stored.shard;
  const TrialBlock& block = stored.block;
  const StudyTally& tally = stored.tally;
  const auto in_range = [&](const WorstTrial& worst) {
    return worst.quantity >= 0 && static_cast<std::size_t>(worst.quantity) < header.quantities.size();
  };
  const bool fits = header.trials > 0 && !header.quantities.empty() && shard.count > 0 && shard.index >= 0 &&
                    shard.index < shard.count && block.first < block.end && block.end <= header.num_trials() &&
                    block.first / header.trials == (block.end - 1) / header.trials &&
                    tally.trials == block.end - block.first && tally.quantities.size() == header.quantities.size() &&
                    (!header.variation || !header.variation->values.empty()) &&
                    std::ranges::all_of(tally.worst, in_range);
  if (!fits) throw std::invalid_argument("its numbers do not fit together");
}

std::string name_of(const Shard& shard) { return fmt::format("{}/{}", shard.index, shard.count); }

/// Throws where a shard is not there, or not whole.
void require_shards(const StudyHeader& header, int count, const std::vector<StoredBlock>& blocks) {
  std::vector<TrialBlock> done;
  for (const StoredBlock& stored : blocks) done.push_back(stored.block);
  for (int i = 0; i < count; ++i) {
    const Shard shard{i, count};
    const TrialBlock wanted = shard.trials_of(header);
    const auto missing = blocks_missing(header, wanted, done, header.trials);
    if (missing.empty()) continue;
    std::uint64_t left = 0;
    for (const TrialBlock& block : missing) left += block.end - block.first;
    if (left == wanted.end - wanted.first) throw InputError("shard " + name_of(shard) + " is missing");
    throw InputError(fmt::format("shard {} is not whole: {} of its {} trials are missing; go on with it by --resume",
                                 name_of(shard), left, wanted.end - wanted.first));
  }
}

}  // namespace

std::filesystem::path blocks_folder(const std::filesystem::path& study_folder) { return study_folder / "blocks"; }

std::string block_file_name(const TrialBlock& block) {
  return fmt::format("block-{:012}-{:012}.json", block.first, block.end);
}

std::string tally_text(const StudyTally& tally) { return tally_json(tally).dump(); }

StudyTally parse_tally(std::string_view text, const std::string& where) {
  try {
    return tally_of(ordered_json::parse(text));
  } catch (const std::exception&) {
    throw InputError(where + ": not the tally of a study's trials");
  }
}

std::string block_text(const StoredBlock& stored) {
  ordered_json json;
  json["schema"] = block_schema;
  json["header"] = header_json(stored.header);
  json["shard"] = {stored.shard.index, stored.shard.count};
  json["first"] = stored.block.first;
  json["end"] = stored.block.end;
  json["tally"] = tally_json(stored.tally);
  return json.dump(1) + "\n";
}

StoredBlock parse_block(std::string_view text, const std::string& file) {
  try {
    const ordered_json json = ordered_json::parse(text);
    if (json.at("schema").get<std::string>() != block_schema) throw std::invalid_argument("of another schema");
    StoredBlock stored;
    stored.header = header_of(json.at("header"));
    stored.shard = {json.at("shard").at(0).get<int>(), json.at("shard").at(1).get<int>()};
    stored.block = {json.at("first").get<std::uint64_t>(), json.at("end").get<std::uint64_t>()};
    stored.tally = tally_of(json.at("tally"));
    require_whole(stored);
    return stored;
  } catch (const std::exception&) {
    throw InputError(file + ": is no whole block of a study; remove it, and run again with --resume");
  }
}

void write_block(const std::filesystem::path& study_folder, const StoredBlock& stored) {
  write_file(blocks_folder(study_folder) / block_file_name(stored.block), block_text(stored));
}

std::vector<StoredBlock> read_blocks(const std::filesystem::path& study_folder) {
  const std::filesystem::path folder = blocks_folder(study_folder);
  if (!std::filesystem::is_directory(folder)) {
    throw InputError(study_folder.string() + ": has no blocks of a study (blocks/)");
  }
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("block-") && name.ends_with(".json")) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  std::vector<StoredBlock> blocks;
  for (const auto& file : files) blocks.push_back(parse_block(read_file(file), file.string()));
  return blocks;
}

void clear_blocks(const std::filesystem::path& study_folder) {
  std::error_code error;
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(blocks_folder(study_folder), error)) {
    if (entry.path().filename().string().starts_with("block-")) files.push_back(entry.path());
  }
  for (const auto& file : files) std::filesystem::remove(file);
}

std::string difference_of(const StudyHeader& is, const StudyHeader& should_be) {
  if (is == should_be) return "";
  if (is.study != should_be.study) return fmt::format("study {}, not {}", is.study, should_be.study);
  if (is.seed != should_be.seed) return fmt::format("seed {}, not {}", is.seed, should_be.seed);
  if (is.trials != should_be.trials) return fmt::format("{} trials, not {}", is.trials, should_be.trials);
  for (std::size_t i = 0; i < is.settings.size() && i < should_be.settings.size(); ++i) {
    const auto& [name, value] = is.settings[i];
    if (is.settings[i] != should_be.settings[i])
      return fmt::format("{} {}, not {}", name, value, should_be.settings[i].second);
  }
  return is.variation != should_be.variation ? "another --vary" : "other settings";
}

MergedStudy merge_blocks(const std::vector<std::filesystem::path>& study_folders) {
  std::vector<StoredBlock> all;
  std::vector<TrialBlock> places;
  MergedStudy merged;
  int shards = 0;
  for (const auto& folder : study_folders) {
    for (StoredBlock& stored : read_blocks(folder)) {
      if (all.empty()) {
        merged.header = stored.header;
        shards = stored.shard.count;
      }
      const std::string difference = difference_of(stored.header, merged.header);
      if (!difference.empty()) {
        throw InputError(fmt::format("{}: is of another study than {}: {}", folder.string(),
                                     study_folders.front().string(), difference));
      }
      if (stored.shard.count != shards) {
        throw InputError(fmt::format("{}: is shard {}, where {} is one of {}", folder.string(), name_of(stored.shard),
                                     study_folders.front().string(), shards));
      }
      places.push_back(stored.block);
      all.push_back(std::move(stored));
    }
  }
  if (all.empty()) throw InputError("there is no block of a study in what was given");
  if (const auto twice = overlap_of(places)) {
    throw InputError(fmt::format("trials {} to {} are given twice", twice->second.first,
                                 std::min(twice->first.end, twice->second.end) - 1));
  }
  require_shards(merged.header, shards, all);
  merged.points.resize(merged.header.num_points(), StudyTally(merged.header.quantities.size()));
  for (const StoredBlock& stored : all)
    merged.points[static_cast<std::size_t>(stored.block.first / merged.header.trials)].add(stored.tally);
  return merged;
}

}  // namespace alidade
