#include <algorithm>

#include "alidade/results/result_folder.h"
#include "alidade/results/save.h"
#include "python/bindings/bindings.h"
#include "python/bindings/ending.h"

namespace alidade::python {
namespace {

py::object object_of(const JsonValue& value);

py::object list_of(const JsonValue::List& list) {
  py::list made(list.size());
  for (std::size_t i = 0; i < list.size(); ++i) made[i] = object_of(list[i]);
  return made;
}

template <typename Number>
py::object array_of(const std::vector<Number>& numbers) {
  return py::array_t<Number>(static_cast<py::ssize_t>(numbers.size()), numbers.data());
}

/// Lists of numbers become arrays.
py::object object_of(const JsonValue& value) {
  return std::visit(
      [](const auto& content) -> py::object {
        using Content = std::decay_t<decltype(content)>;
        if constexpr (std::is_same_v<Content, std::nullptr_t>) {
          return py::none();
        } else if constexpr (std::is_same_v<Content, JsonValue::List>) {
          return list_of(content);
        } else if constexpr (std::is_same_v<Content, JsonValue::Object>) {
          py::dict made;
          for (const auto& [key, member] : content) made[py::str(key)] = object_of(member);
          return made;
        } else if constexpr (std::is_same_v<Content, std::string>) {
          return text_of(content);
        } else if constexpr (requires { content.front(); }) {
          return array_of(content);
        } else {
          return py::cast(content);
        }
      },
      value.content());
}

/// result.json without its tables and grids.
std::string header_text(const Outcome& outcome) {
  const ResultDocument& from = outcome.job.document;
  ResultDocument head;
  head.command = from.command;
  head.argv = from.argv;
  head.created_utc = from.created_utc;
  head.seed = from.seed;
  head.seconds = from.seconds;
  head.inputs = from.inputs;
  head.verdict = from.verdict;
  head.counts = from.counts;
  head.assumed = from.assumed;
  head.estimate = from.estimate;
  head.stddev = from.stddev;
  head.stddev_model = from.stddev_model;
  head.covariance_names = from.covariance_names;
  head.covariance_upper = from.covariance_upper;
  for (const NamedBytes& file : outcome.job.files) head.files.push_back(file.name);
  settle(head);
  return result_text(head);
}

template <class Items>
auto named(const Items& items, const std::string& name) {
  const auto found = std::find_if(items.begin(), items.end(), [&](const auto& each) { return each.name == name; });
  if (found == items.end()) throw py::key_error(name);
  return *found;
}

template <class Items>
std::vector<std::string> names_of(const Items& items) {
  std::vector<std::string> names;
  for (const auto& each : items) names.push_back(each.name);
  return names;
}

py::list columns_of(const DataTable& table) {
  py::list made;
  for (const auto& [name, column] : table.columns) made.append(py::make_tuple(name, object_of(column)));
  return made;
}

py::dict grid_of(const DataGrid& grid) {
  py::dict made;
  made["u0_px"] = grid.u0_px;
  made["v0_px"] = grid.v0_px;
  made["du_px"] = grid.du_px;
  made["dv_px"] = grid.dv_px;
  for (const auto& [name, values] : grid.values) {
    made[py::str(name)] = py::array_t<double>({grid.rows, grid.cols}, values.data());
  }
  return made;
}

void save_outcome(const Outcome& outcome, const std::string& folder) {
  JobOutcome copy = outcome.job;
  const Released released;
  save(std::move(copy), folder);
}

/// Files of an earlier run into a folder, as that run would have put them there.
void save_files(const std::vector<std::pair<std::string, py::bytes>>& files, int exit_code, const std::string& folder) {
  std::vector<std::pair<std::string, std::string>> held;
  for (const auto& [name, bytes] : files) held.emplace_back(name, std::string(bytes));
  const Released released;
  ResultDocument document;
  document.verdict.exit_code = static_cast<ExitCode>(exit_code);
  ResultFolder results(folder, document);
  for (const auto& [name, bytes] : held) results.add(name, bytes);
  results.commit();
}

void rename_inputs(Outcome& outcome, const std::vector<std::pair<std::string, std::string>>& names) {
  for (InputFile& input : outcome.job.document.inputs) {
    for (const auto& [file, name] : names) {
      if (input.name == file) input.name = name;
    }
  }
}

}  // namespace

void bind_outcome(py::module_& module) {
  py::class_<Outcome, OutcomePtr>(module, "Outcome", plain_type(), "What a job leaves.")
      .def_readonly("camera", &Outcome::camera)
      .def_property_readonly("model_covariance",
                             [](const Outcome& self) { return matrix_array(self.model_covariance); })
      .def_property_readonly("lines",
                             [](const Outcome& self) {
                               py::list lines;
                               for (const std::string& line : self.job.lines) lines.append(text_of(line, "replace"));
                               return lines;
                             })
      .def_property_readonly("tables", [](const Outcome& self) { return names_of(self.job.document.data); })
      .def_property_readonly("grids", [](const Outcome& self) { return names_of(self.job.document.grids); })
      .def_property_readonly("files", [](const Outcome& self) { return names_of(self.job.files); })
      .def("header", &header_text)
      .def("table",
           [](const Outcome& self, const std::string& name) { return columns_of(named(self.job.document.data, name)); })
      .def("grid",
           [](const Outcome& self, const std::string& name) { return grid_of(named(self.job.document.grids, name)); })
      .def("file",
           [](const Outcome& self, const std::string& name) { return py::bytes(named(self.job.files, name).bytes); })
      .def("rename_inputs", &rename_inputs)
      .def("save", &save_outcome);
  module.def("save_files", &save_files);
}

}  // namespace alidade::python
