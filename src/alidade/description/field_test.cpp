#include "alidade/description/field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace alidade {
namespace {

enum class Shape { flat, bow };

struct Config {
  int count = 3;
  double gap_m = 0.02;
  std::optional<double> glass_m;
  bool is_quick = false;
  std::string name = "left";
  std::vector<std::string> fixed = {"skew"};
  Shape shape = Shape::flat;
  int width_px = 0, height_px = 0;
  double square_m = 0.0;
  std::vector<double> start;
};

FieldList fields_of(Config& config) {
  return {{.name = "count", .value = &config.count, .help = "How many", .limits = {1, 10}},
          {.name = "gap_m", .value = &config.gap_m, .help = "Gap", .limits = {0.0, 10.0}},
          {.name = "glass_m", .value = &config.glass_m, .help = "Glass", .limits = {.min = 0.0, .is_above_min = true}},
          {.name = "is_quick", .value = &config.is_quick, .help = "Quick", .option = "--quick"},
          {.name = "name", .value = &config.name, .help = "Name"},
          {.name = "fixed", .value = &config.fixed, .help = "Fixed", .option = "--fix"},
          {.name = "board_shape",
           .value = words_code<Shape>(config.shape, {{Shape::flat, "flat"}, {Shape::bow, "bow"}}),
           .help = "Shape"},
          {.name = "size", .value = pair_code(config.width_px, config.height_px, 1000, "WxH"), .help = "Size"},
          {.name = "square_m", .value = length_code(config.square_m, 5e-4, 2.0), .help = "Square"},
          {.name = "start",
           .value = numbers_code(
               2, [&config] { return config.start; },
               [&config](const std::vector<double>& numbers) { config.start = numbers; }),
           .help = "Start"}};
}

const Field& field(const FieldList& fields, const std::string& name) {
  for (const Field& each : fields) {
    if (each.name == name) return each;
  }
  throw std::logic_error(name);
}

TEST(Field, TakesAndWritesEveryKindOfValue) {
  Config config;
  const FieldList fields = fields_of(config);
  for (const auto& [name, text] : std::vector<std::pair<std::string, std::string>>{{"count", "7"},
                                                                                   {"gap_m", "0.5"},
                                                                                   {"glass_m", "0.01"},
                                                                                   {"is_quick", "true"},
                                                                                   {"name", "a b"},
                                                                                   {"fixed", "k3"},
                                                                                   {"board_shape", "bow"},
                                                                                   {"size", "640x480"},
                                                                                   {"square_m", "0.025"},
                                                                                   {"start", "500,-1.5"}}) {
    EXPECT_EQ(set_field(field(fields, name), text), "");
    EXPECT_EQ(value_text(field(fields, name)), text);
  }
  EXPECT_EQ(config.count, 7);
  EXPECT_EQ(config.glass_m, 0.01);
  EXPECT_EQ(config.shape, Shape::bow);
  EXPECT_EQ(config.height_px, 480);
  EXPECT_EQ(set_field(field(fields, "fixed"), "k2", false), "");
  EXPECT_THAT(config.fixed, ::testing::ElementsAre("k3", "k2"));
}

TEST(Field, SaysWhatIsWrongAndKeepsWhatStood) {
  Config config;
  const FieldList fields = fields_of(config);
  const auto fault = [&](const std::string& name, const std::string& text) {
    return set_field(field(fields, name), text);
  };
  EXPECT_EQ(fault("count", "2.5"), "'2.5' is not a whole number");
  EXPECT_EQ(fault("count", "99999999999"), "'99999999999' is not a whole number");
  EXPECT_EQ(fault("count", "0"), "'0' is not within 1 to 10");
  for (const char* text : {"nan", "inf", "1e999", "", "1 ", "0x1", "one"}) {
    EXPECT_EQ(fault("gap_m", text), "'" + std::string(text) + "' is not a finite number");
  }
  EXPECT_EQ(fault("glass_m", "0"), "'0' is not above 0");
  EXPECT_EQ(fault("is_quick", "yes"), "'yes' is not true or false");
  EXPECT_EQ(fault("board_shape", "round"), "'round' is not one of flat, bow");
  EXPECT_EQ(fault("size", "640x"), "'640x' is not WxH");
  EXPECT_EQ(fault("size", "640x2000"), "'640x2000' is not WxH");
  EXPECT_EQ(fault("start", "1,2,3"), "'1,2,3' is 3 numbers, not 2");
  EXPECT_EQ(fault("start", "1,nan"), "'nan' is not a finite number");
  EXPECT_EQ(fault("start", "1,"), "'' is not a finite number");
  EXPECT_THAT(config.start, ::testing::IsEmpty());
  EXPECT_EQ(config.count, 3);
  EXPECT_EQ(config.gap_m, 0.02);
  EXPECT_FALSE(config.glass_m);
}

TEST(Field, ChecksWhatAProgramFilledIn) {
  Config config;
  EXPECT_THAT(faults_of(fields_of(config)), ::testing::IsEmpty());
  config.count = 11;
  config.gap_m = std::nan("");
  config.glass_m = -1.0;
  EXPECT_THAT(faults_of(fields_of(config)),
              ::testing::ElementsAre("count is 11, not within 1 to 10", "gap_m is not a finite number",
                                     "glass_m is -1, not above 0"));
}

TEST(Field, NamesItsOptionAndItsForm) {
  Config config;
  const FieldList fields = fields_of(config);
  EXPECT_EQ(option_of(field(fields, "glass_m")), "--glass");
  EXPECT_EQ(option_of(field(fields, "board_shape")), "--board-shape");
  EXPECT_EQ(option_of(field(fields, "fixed")), "--fix");
  EXPECT_EQ(form_text(field(fields, "count")), "N 1..10");
  EXPECT_EQ(form_text(field(fields, "glass_m")), "NUMBER > 0");
  EXPECT_EQ(form_text(field(fields, "board_shape")), "flat|bow");
  EXPECT_EQ(form_text(field(fields, "is_quick")), "");
}

}  // namespace
}  // namespace alidade
