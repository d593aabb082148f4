#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/study/study_plan.h"

namespace alidade {

/// A block of trials on disk, and the study and shard that it belongs to.
struct StoredBlock {
  StudyHeader header;
  Shard shard;
  TrialBlock block;
  StudyTally tally;
};

/// DIR/blocks, the folder with the blocks of a study, one file each.
[[nodiscard]] std::filesystem::path blocks_folder(const std::filesystem::path& study_folder);
/// "block-000000000000-000000005000.json"
[[nodiscard]] std::string block_file_name(const TrialBlock& block);

[[nodiscard]] std::string block_text(const StoredBlock& stored);
/// Throws InputError "FILE: WHAT".
[[nodiscard]] StoredBlock parse_block(std::string_view text, const std::string& file);
/// Writes a block to a file, which gets its name when it is complete.
void write_block(const std::filesystem::path& study_folder, const StoredBlock& stored);
/// Reads every block of a folder, in order of trials. Throws InputError for a file that is not a block, or a folder
/// without blocks/.
[[nodiscard]] std::vector<StoredBlock> read_blocks(const std::filesystem::path& study_folder);
/// Removes the blocks of an earlier study.
void clear_blocks(const std::filesystem::path& study_folder);

/// The difference between two studies, in a few words: "seed 2, not 1"; empty if they are the same.
[[nodiscard]] std::string difference_of(const StudyHeader& is, const StudyHeader& should_be);

/// Writes and reads a tally as text, for exchange between processes.
[[nodiscard]] std::string tally_text(const StudyTally& tally);
[[nodiscard]] StudyTally parse_tally(std::string_view text, const std::string& where);

/// The merged blocks of all shards of one study: a tally per point. Throws InputError that names what is missing
/// ("shard 3/8"), duplicated, or from another study.
struct MergedStudy {
  StudyHeader header;
  std::vector<StudyTally> points;
};
[[nodiscard]] MergedStudy merge_blocks(const std::vector<std::filesystem::path>& study_folders);

}  // namespace alidade
