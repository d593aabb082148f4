#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>

#include "alidade/estimation/config_error.h"
#include "alidade/estimation/progress.h"
#include "alidade/files/files.h"
#include "cli/app/run.h"
#include "cli/app/terminal.h"
#include "python/bindings/bindings.h"

namespace alidade::python {
namespace {

/// What is wrong with the input is a ValueError, in the one line that the command prints.
void translate(std::exception_ptr thrown) {
  const auto wrong = [](const char* what) { PyErr_SetString(PyExc_ValueError, cli::one_line(what).c_str()); };
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
}

}  // namespace alidade::python
