#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <optional>
#include <sstream>
#include <vector>

#include "alidade/geometry/degree.h"
#include "alidade/heads/head_server.h"

namespace alidade {
namespace {

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream in(line);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

std::string state_of(const SimulatedHeadConfig& head) {
  return fmt::format("1\n1\nmin_az={:f}\nmax_az={:f}\nmin_el={:f}\nmax_el={:f}\nsouth_zero=0\nrot_type=AzEl\ndone\n",
                     -head.high_rad[0] / degree, -head.low_rad[0] / degree, head.low_rad[1] / degree,
                     head.high_rad[1] / degree);
}

std::optional<double> angle_in(const std::string& word) {
  char* end = nullptr;
  const double value = std::strtod(word.c_str(), &end);
  if (word.empty() || *end != '\0' || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace

std::optional<std::string> rotctl_answer(HeadPlant& plant, const std::string& line, double t_s) {
  const std::vector<std::string> words = words_of(line);
  plant.hear(t_s);
  if (words.empty()) return "";
  const std::string& command = words.front();
  if (command == "q" || command == "Q") return std::nullopt;
  if (command == "p" || command == "\\get_pos") {
    const Eigen::Vector2d at = plant.reading(t_s) / degree;
    const double zero = 0.0;  // never "-0.000000"
    return fmt::format("{:.6f}\n{:.6f}\n", zero - at[0], zero + at[1]);
  }
  if (command == "S" || command == "\\stop") {
    plant.stop(t_s);
    return "RPRT 0\n";
  }
  if (command == "_" || command == "\\get_info") return "alidade simulate head\n";
  if (command == "\\dump_state") return state_of(plant.config());
  const bool is_park = command == "K" || command == "\\park";
  if (!is_park && command != "P" && command != "\\set_pos") return command.starts_with('\\') ? "RPRT -4\n" : "";
  std::optional<double> azimuth = 0.0, elevation = 0.0;
  if (!is_park) {
    azimuth = words.size() == 3 ? angle_in(words[1]) : std::nullopt;
    elevation = words.size() == 3 ? angle_in(words[2]) : std::nullopt;
  }
  if (!azimuth || !elevation) return "RPRT -1\n";
  const Eigen::Vector2d target = Eigen::Vector2d(-*azimuth, *elevation) * degree;
  const SimulatedHeadConfig& head = plant.config();
  if (!HeadLimits{head.low_rad, head.high_rad, true, ""}.hold(target)) return "RPRT -1\n";
  plant.go_to(t_s, target);
  return "RPRT 0\n";
}

}  // namespace alidade
