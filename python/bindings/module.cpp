#include <algorithm>
#include <cctype>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <string>
#include <string_view>

#include "alidade/estimation/config_error.h"
#include "alidade/estimation/progress.h"
#include "alidade/files/files.h"
#include "cli/app/run.h"
#include "cli/app/terminal.h"
#include "python/bindings/bindings.h"

namespace alidade::python {
namespace {

bool is_of_option(char letter) { return letter == '-' || std::islower(letter) != 0 || std::isdigit(letter) != 0; }

/// The keyword of an option without its dashes: "sigma-px" is sigma_px.
std::string keyword_of(std::string option) {
  std::ranges::replace(option, '-', '_');
  const bool is_of_board = option == "square" || option == "marker";
  return is_of_board ? option + "_m" : option;
}

/// A sentence of the command line with the keywords for its options: "--sigma-px: '-1' is not above 0" begins with
/// sigma_px, "give --glass 0.01" ends with glass=0.01, "see alidade track --help" is "see help(alidade.track)".
std::string in_keywords(std::string text) {
  constexpr std::string_view see = "see alidade ", help = " --help";
  if (const std::size_t at = text.find(see), end = text.find(help); at != text.npos && end > at && end != text.npos) {
    std::string command = text.substr(at + see.size(), end - at - see.size());
    std::ranges::replace(command, ' ', '.');
    text.replace(at, end + help.size() - at, "see help(alidade." + command + ")");
  }
  for (std::size_t at = 0; (at = text.find("--", at)) != text.npos; ++at) {
    const bool begins = at == 0 || (!is_of_option(text[at - 1]) && text[at - 1] != '/');
    if (!begins || at + 2 >= text.size() || std::islower(text[at + 2]) == 0) continue;
    const auto end = static_cast<std::size_t>(
        std::find_if_not(text.begin() + static_cast<std::ptrdiff_t>(at) + 2, text.end(), is_of_option) - text.begin());
    const bool has_value = end + 1 < text.size() && text[end] == ' ' &&
                           (std::isupper(text[end + 1]) != 0 || std::isdigit(text[end + 1]) != 0);
    if (has_value) text[end] = '=';
    text.replace(at, end - at, keyword_of(text.substr(at + 2, end - at - 2)));
  }
  return text;
}

/// What is wrong with the input is a ValueError, in the one line that the command prints.
void translate(std::exception_ptr thrown) {
  const auto wrong = [](const char* what) {
    PyErr_SetObject(PyExc_ValueError, text_of(in_keywords(cli::one_line(what)), "replace").ptr());
  };
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const cli::UsageError& error) {
    wrong(error.what());
  } catch (const ConfigError& error) {
    wrong(error.what());
  } catch (const InputError& error) {
    wrong(error.what());
  } catch (const std::filesystem::filesystem_error& error) {
    wrong((error.path1().string() + ": " + error.code().message()).c_str());
  } catch (const cv::Exception& error) {
    PyErr_SetString(PyExc_RuntimeError, ("internal: OpenCV: " + error.err + " (a bug in alidade)").c_str());
  }
}

/// A core is neither copied nor pickled, what holds it sees to that: where nothing did, pickle's protocols 0 and 1
/// ended the process.
void refuse_pickles(const py::module_& module) {
  for (const auto& [name, value] : py::dict(module.attr("__dict__"))) {
    if (!py::isinstance<py::type>(value) || PyType_IsSubtype(reinterpret_cast<PyTypeObject*>(value.ptr()),
                                                             reinterpret_cast<PyTypeObject*>(PyExc_Exception)) != 0)
      continue;
    const std::string said =
        "an object of alidade._alidade." + std::string(py::str(name)) + " is neither copied nor pickled";
    const auto refuse = [said](const py::object&, int) -> py::object { throw py::type_error(said); };
    value.attr("__reduce_ex__") = py::cpp_function(refuse, py::is_method(value));
  }
}

}  // namespace

PYBIND11_MODULE(_alidade, module) {
  py::options options;
  options.disable_function_signatures();
  module.doc() = "The compiled half of alidade.";
  module.attr("__version__") = ALIDADE_VERSION;
  py::register_exception_translator(&translate);
  py::register_exception<Interrupted>(module, "Interrupted");
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  bind_waiting(module);
  bind_camera(module);
  bind_board(module);
  bind_outcome(module);
  bind_calibrate(module);
  bind_capture(module);
  bind_commands(module);
  bind_head(module);
  bind_images(module);
  bind_live(module);
  bind_localizer(module);
  refuse_pickles(module);
}

}  // namespace alidade::python
