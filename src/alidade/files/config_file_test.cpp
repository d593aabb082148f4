#include "alidade/files/config_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "alidade/files/files.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

struct Settings {
  double gap_m = 0.02;
  int count = 3;
  std::vector<std::string> fixed = {};
  std::vector<double> start = {};
};

FieldList fields_of(Settings& settings) {
  return {{.name = "gap_m", .value = &settings.gap_m, .help = "Gap [m]", .limits = {0.0, 10.0}},
          {.name = "count", .value = &settings.count, .help = "How many", .limits = {1, 10}},
          {.name = "fixed", .value = &settings.fixed, .help = "Parameters fixed"},
          {.name = "start",
           .value = numbers_code(
               2, [&settings] { return settings.start; },
               [&settings](const std::vector<double>& numbers) { settings.start = numbers; }),
           .help = "Start"}};
}

class ConfigFile : public ::testing::Test, protected testing::TemporaryFolder {
 protected:
  std::string fault(const std::string& text) {
    write_file(path() / "run.yaml", text);
    Settings settings;
    try {
      read_config(path() / "run.yaml", fields_of(settings), [](const Field&) { return false; });
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
};

TEST_F(ConfigFile, IsTakenOverButForWhatWasTyped) {
  write_file(path() / "run.yaml", "gap_m: 0.5\ncount: 7\nfixed: [k3, p1]\nstart: [500, 510]\n");
  Settings settings;
  const auto names =
      read_config(path() / "run.yaml", fields_of(settings), [](const Field& field) { return field.name == "count"; });
  EXPECT_EQ(settings.gap_m, 0.5);
  EXPECT_EQ(settings.count, 3);
  EXPECT_THAT(settings.fixed, ::testing::ElementsAre("k3", "p1"));
  EXPECT_THAT(settings.start, ::testing::ElementsAre(500.0, 510.0));
  EXPECT_EQ(names.size(), 4u);
}

TEST_F(ConfigFile, TakesTheNamesOfOptions) {
  bool is_dark = false;
  double noise_px = 0.0, gap_m = 0.0;
  const FieldList fields{
      {.name = "image_noise_px", .value = &noise_px, .help = "Noise [px]"},
      {.name = "gap_m", .value = &gap_m, .help = "Gap [m]", .option = "--distance", .old_options = {"--far-off"}},
      {.name = "is_dark", .value = &is_dark, .help = "Dark", .option = "--dark"}};
  const auto read = [&](const std::string& text) {
    write_file(path() / "run.yaml", text);
    return read_config(path() / "run.yaml", fields, [](const Field&) { return false; });
  };
  EXPECT_THAT(read("image-noise: 0.25\ndistance: 2\ndark: true\n"),
              ::testing::ElementsAre("image_noise_px", "gap_m", "is_dark"));
  EXPECT_EQ(noise_px, 0.25);
  EXPECT_EQ(gap_m, 2.0);
  EXPECT_TRUE(is_dark);
  EXPECT_THAT(read("image_noise: 0.5\nfar-off: 3\n"), ::testing::ElementsAre("image_noise_px", "gap_m"));
  EXPECT_EQ(noise_px, 0.5);
  EXPECT_EQ(gap_m, 3.0);
  EXPECT_THROW(read("gap: 3\n"), InputError) << "the option has another name";
  EXPECT_THROW(read("distance: 3\ngap_m: 2\n"), InputError) << "twice";
}

TEST_F(ConfigFile, NamesWhatIsWrong) {
  EXPECT_THAT(fault("gapp_m: 1\n"), ::testing::HasSubstr("gapp_m: is not a key of this command; known: gap_m count"));
  EXPECT_THAT(fault("gap_m: nan\n"), ::testing::HasSubstr("gap_m: 'nan' is not a finite number"));
  EXPECT_THAT(fault("gap_m: [1, 2]\n"), ::testing::HasSubstr("gap_m: is not one value"));
  EXPECT_THAT(fault("start: [1, 2, 3]\n"), ::testing::HasSubstr("start: '1,2,3' is 3 numbers, not 2"));
  EXPECT_NE(fault("start: [1, [2]]\n"), "");
  EXPECT_THAT(fault("count: 11\n"), ::testing::HasSubstr("count: '11' is not within 1 to 10"));
  EXPECT_NE(fault("gap_m: {\n"), "");
  EXPECT_NE(fault("- gap_m\n"), "");
}

TEST_F(ConfigFile, WhatIsWrittenReadsBack) {
  Settings settings{0.25, 9, {"k2"}}, read;
  write_file(path() / "run.yaml", config_text(fields_of(settings)));
  read_config(path() / "run.yaml", fields_of(read), [](const Field&) { return false; });
  EXPECT_EQ(read.gap_m, 0.25);
  EXPECT_EQ(read.count, 9);
  EXPECT_EQ(read.fixed, settings.fixed);
}

}  // namespace
}  // namespace alidade
