#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/study/study_plan.h"

namespace alidade {

/// What is on disk of a study: a block of trials, and of which study and shard it is.
struct StoredBlock {
  StudyHeader header;
  Shard shard;
  TrialBlock block;
  StudyTally tally;
};

/// DIR/blocks, where the blocks of a study stand, a file for each.
[[nodiscard]] std::filesystem::path blocks_folder(const std::filesystem::path& study_folder);
/// "block-000000000000-000000005000.json"
[[nodiscard]] std::string block_file_name(const TrialBlock& block);

[[nodiscard]] std::string block_text(const StoredBlock& stored);
/// Throws InputError "FILE: WHAT".
[[nodiscard]] StoredBlock parse_block(std::string_view text, const std::string& file);
/// A file under its own name once it is whole.
void write_block(const std::filesystem::path& study_folder, const StoredBlock& stored);
/// Every block of a folder, in order of trials. Throws InputError for a file that is none, or of a folder without
/// blocks/.
[[nodiscard]] std::vector<StoredBlock> read_blocks(const std::filesystem::path& study_folder);
/// Removes the blocks of an earlier study.
void clear_blocks(const std::filesystem::path& study_folder);

/// How two studies differ, in a few words: "seed 2, not 1"; empty where they are the same.
[[nodiscard]] std::string difference_of(const StudyHeader& is, const StudyHeader& should_be);

/// A tally as text, and back: what one process says to another.
[[nodiscard]] std::string tally_text(const StudyTally& tally);
[[nodiscard]] StudyTally parse_tally(std::string_view text, const std::string& where);

/// The blocks of all shards of one study, put together: a tally for each point. Throws InputError that names what is
/// missing ("shard 3/8"), given twice, or of another study.
struct MergedStudy {
  StudyHeader header;
  std::vector<StudyTally> points;
};
[[nodiscard]] MergedStudy merge_blocks(const std::vector<std::filesystem::path>& study_folders);

}  // namespace alidade
