#include "alidade/board/board.h"

#include <algorithm>

#include "alidade/board/board_fields.h"
#include "alidade/estimation/config_error.h"
#include "python/bindings/bindings.h"
#include "python/bindings/fields.h"

namespace alidade::python {
namespace {

bool is_called(const Field& field, const std::string& name) {
  std::string option = option_of(field).substr(2);
  std::ranges::replace(option, '-', '_');
  return field.name == name || option == name;
}

/// The numbers of a vector in one text, as its field reads them.
std::string one_text(const std::vector<std::string>& parts) {
  std::string text;
  for (const std::string& part : parts) text += (text.empty() ? "" : ",") + part;
  return text;
}

Board board_of(const Texts& values) {
  Board board{.cols = 0, .rows = 0, .square_m = 0.0, .dictionary = ""};
  set_fields(fields_of(board), values);
  if (const std::string fault = complete(board); !fault.empty()) throw ConfigError(fault);
  return board;
}

/// Fields that have a value as texts, by name or by option.
py::dict board_dict(Board board, bool by_option) {
  py::dict values;
  for (const Field& field : fields_of(board)) {
    const std::string text = value_text(field);
    if (!text.empty()) values[py::str(by_option ? option_of(field) : field.name)] = text;
  }
  return values;
}

Array point_array(const Board& board) {
  const std::vector<Eigen::Vector3d> points = points_in_board(board);
  Array array({static_cast<py::ssize_t>(points.size()), py::ssize_t{3}});
  for (std::size_t i = 0; i < points.size(); ++i) std::copy_n(points[i].data(), 3, array.mutable_data() + 3 * i);
  return array;
}

}  // namespace

void set_fields(const FieldList& fields, const Texts& values) {
  for (const auto& [named, texts] : values) {
    const std::string& name = named;
    const auto field = std::ranges::find_if(fields, [&](const Field& each) { return is_called(each, name); });
    if (field == fields.end()) throw ConfigError(name + ": there is no such field");
    const bool is_list = std::holds_alternative<std::vector<std::string>*>(field->value);
    if (texts.empty() && is_list) std::get<std::vector<std::string>*>(field->value)->clear();
    const std::vector<std::string> parts = is_list || texts.empty() ? texts : std::vector{one_text(texts)};
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const std::string fault = set_field(*field, parts[i], i == 0);
      if (!fault.empty()) throw ConfigError(name + ": " + fault);
    }
  }
}

void bind_board(py::module_& module) {
  py::class_<Board>(module, "Board", plain_type(), "A calibration target.")
      .def(py::init(&board_of))
      .def_readonly("cols", &Board::cols)
      .def_readonly("rows", &Board::rows)
      .def_readonly("square_m", &Board::square_m)
      .def_readonly("marker_m", &Board::marker_m)
      .def_readonly("dictionary", &Board::dictionary)
      .def_property_readonly("kind", [](const Board& self) { return std::string(kind_name(self.kind)); })
      .def_property_readonly("num_points", [](const Board& self) { return num_points(self); })
      .def_property_readonly("points", &point_array)
      .def_property_readonly("texts", [](const Board& self) { return board_dict(self, false); })
      .def_property_readonly("options", [](const Board& self) { return board_dict(self, true); });
}

}  // namespace alidade::python
