#!/usr/bin/env python3
"""What others build on: package_test.py BUILD. Installs the build into a folder, and uses it from outside the tree: by
find_package, by pkg-config, by add_subdirectory (configured only). Headers that are installed include installed ones,
Eigen and std; the library shows nothing that they do not declare; the man pages and the completion are there."""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
build = None


def run(*words, **options):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, **options)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, words))}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}")
    return done.stdout


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.prefix = cls.folder / "installed"
        run("cmake", "--install", build, "--prefix", cls.prefix)
        cls.library = next(cls.prefix.glob("lib*/**/libalidade.so"))
        cls.alidade, cls.examples = cls.prefix / "bin" / "alidade", cls.folder / "examples"
        # By the library's own compiler; one of them by the system's too, below.
        compiler = re.search(r"^CMAKE_CXX_COMPILER:\w+=(.*)$", (build / "CMakeCache.txt").read_text(), re.MULTILINE).group(1)
        run("cmake", "-S", ROOT / "examples", "-B", cls.examples, f"-DCMAKE_PREFIX_PATH={cls.prefix}",
            f"-DCMAKE_CXX_COMPILER={compiler}")
        run("cmake", "--build", cls.examples, "--parallel", "2")

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def test_examples_build_and_run_against_the_package(self):
        outside, alidade = self.examples, self.alidade
        photos, camera = self.folder / "photos", self.folder / "camera.yml"
        run(alidade, "simulate", "board", "--board", "9x6", "--square", "0.025", "--photos", "8", "--size", "640x480",
            "--out", photos, "--quiet")
        said = run(outside / "01_calibrate", photos, camera)
        self.assertIn("fx", said)
        run(alidade, "calibrate", photos, "--board", "9x6", "--square", "0.025", "--out", self.folder / "result",
            "--quiet", "--no-report")
        fx = {name: float(re.search(r"fx\D+([\d.]+)", run(alidade, "camera", "show", file)).group(1))
              for name, file in (("library", camera), ("command", self.folder / "result" / "camera.yaml"))}
        self.assertAlmostEqual(fx["library"], fx["command"], places=2, msg="the library and the command say the same")
        self.follow_a_target(outside, alidade)

    def follow_a_target(self, outside, alidade):
        """The examples of heads: what they leave is what the commands leave."""
        for name, words, command in (
                ("track", ("track", "--scenario", "B"), lambda sim: ("track", sim / "events.csv", "--rig", sim / "rig.yaml",
                                                                     "--sigma-a", "1", "--sigma-px", "0.5")),
                ("identify", ("servo",), lambda sim: ("identify", sim / "log.csv"))):
            sim, left = self.folder / f"sim_{name}", self.folder / f"left_{name}"
            run(alidade, "simulate", *words, "--out", sim, "--quiet")
            run(alidade, *command(sim), "--out", left, "--quiet", "--no-report")
            inputs = [word for word in command(sim)[1:] if isinstance(word, pathlib.Path)]
            number = {"track": "03", "identify": "04"}[name]
            run(outside / f"{number}_{name}", *inputs, self.folder / f"saved_{name}")
            for document in (saved := json.loads((self.folder / f"saved_{name}" / "result.json").read_text()),
                             wanted := json.loads((left / "result.json").read_text())):
                for key in ("argv", "created_utc", "seconds", "inputs"):
                    document.pop(key, None)
            self.assertEqual(saved, wanted, "the library and the command leave the same")
        self.assertIn("px RMS", run(outside / "05_servo"))

    def test_python_module_stands_alone(self):
        module = self.prefix / "lib" / "python3" / "dist-packages"
        if not (module / "alidade").is_dir():
            self.skipTest("the module was not built")
        run("/usr/bin/python3", "-W", "error", "-c", "import alidade as al; al.simulate.track(scenario='C')", cwd=self.folder,
            env={**os.environ, "PYTHONPATH": str(module)})

    def test_the_observe_example_leaves_what_the_command_leaves(self):
        outside, alidade, log = self.examples, self.alidade, self.folder / "rotation"
        run(alidade, "simulate", "rotation", "--duration", "6", "--out", log, "--quiet")
        said = run(outside / "02_observe", log / "log.csv", "780", "582", self.folder / "observed")
        self.assertIn("start", said)
        run(alidade, "observe", log / "log.csv", "--size", "780x582", "--out", self.folder / "observe", "--quiet")
        for name in ("camera.yaml", "intrinsics.csv"):
            texts = {(self.folder / folder / name).read_text() for folder in ("observed", "observe")}
            self.assertEqual(len(texts), 1, f"{name}: the library and the command leave the same")

    def test_examples_of_rangefinder_and_rig_run(self):
        outside, alidade = self.examples, self.alidade
        shots, views = self.folder / "shots", self.folder / "views"
        run(alidade, "simulate", "rangefinder", "--out", shots, "--quiet")
        said = run(outside / "06_rangefinder", shots / "shots.csv", shots / "camera.yaml", shots / "corners.csv",
                   self.folder / "beam")
        self.assertIn("origin_x_m", said)
        self.assertTrue((self.folder / "beam" / "rangefinder.yaml").exists())
        said = run(outside / "09_project", self.folder / "beam" / "rangefinder.yaml", shots / "camera.yaml", "2.31")
        command = json.loads(run(alidade, "project", "--beam", self.folder / "beam" / "rangefinder.yaml", "--camera", shots / "camera.yaml", "--range", "2.31",
                                 "--json", cwd=self.folder))
        pixel = re.search(r"pixel \(([\d.]+), ([\d.]+)\)", said).groups()
        self.assertEqual(pixel, tuple(f"{one:.2f}" for one in command["estimate"]["px"]))
        run(alidade, "simulate", "rig", "--out", views, "--quiet")
        said = run(outside / "07_rig", views / "views.csv", views / "camera_1.yaml", views / "camera_2.yaml",
                   self.folder / "rig.yaml")
        self.assertIn("head2.base_x_m", said)
        self.assertIn("heads", (self.folder / "rig.yaml").read_text())

    def test_the_localize_example_leaves_what_the_command_leaves(self):
        outside, alidade = self.examples, self.alidade
        sea, result = self.folder / "sea", self.folder / "localized"
        run(alidade, "simulate", "underwater", "--points", "20", "--frames", "40", "--rate", "30", "--out", sea, "--quiet")
        words = [sea / "sights.csv", sea / "camera.yaml", sea / "target.yaml"]
        self.assertIn("localised in 40 of 40 frames", run(outside / "08_localize", *words, cwd=self.folder))
        run(alidade, "localize", words[0], "--camera", words[1], "--target", words[2], "--out", self.folder / "command",
            "--quiet", "--no-report")
        for name in ("trajectory.tum", "poses.csv", "map.csv", "map.ply"):
            self.assertEqual((result / name).read_text(), (self.folder / "command" / name).read_text(), name)

    def test_pkg_config_links_with_the_systems_compiler(self):
        environment = {**os.environ, "PKG_CONFIG_PATH": str(self.library.parent / "pkgconfig")}
        flags = run("pkg-config", "--cflags", "--libs", "alidade", env=environment).split()
        run("c++", "-std=c++20", ROOT / "examples" / "01_calibrate.cpp", "-o", self.folder / "calibrate", *flags,
            f"-Wl,-rpath,{self.library.parent}")
        photos = self.folder / "few_photos"
        run(self.alidade, "simulate", "board", "--board", "9x6", "--square", "0.025", "--photos", "6", "--size", "640x480",
            "--out", photos, "--quiet")
        said = [run(program, photos, self.folder / "of_few.yml") for program in (self.folder / "calibrate", self.examples / "01_calibrate")]
        self.assertEqual(*said)

    def test_headers_include_installed_ones_eigen_and_std(self):
        include = self.prefix / "include"
        headers = sorted(include.rglob("*.h"))
        self.assertGreater(len(headers), 10)
        for header in headers:
            for name in re.findall(r'#include "([^"]+)"', header.read_text()):
                self.assertTrue((include / name).exists(), f"{header.name} includes {name}, which is not installed")
            for name in re.findall(r"#include <([^>]+)>", header.read_text()):
                self.assertTrue(name.startswith("Eigen/") or re.fullmatch(r"[a-z_]+", name), f"{header.name}: <{name}>")

    def test_the_library_shows_what_public_headers_declare(self):
        symbols = run("nm", "--dynamic", "--defined-only", "--demangle", self.library)
        # Functions compiled for several processors have a resolver, which compilers never hide.
        shown = [line for line in symbols.splitlines() if "[clone" not in line]
        names = re.findall(r" T alidade::(?:detail::)?([\w~:]+)", "\n".join(shown))
        declared = "".join(header.read_text() for header in (self.prefix / "include").rglob("*.h"))
        self.assertIn("calibrate", names)
        hidden = sorted({name for name in names if not re.search(rf"\b{re.escape(name.split('::')[0])}\b", declared)})
        self.assertEqual(hidden, [], "private names are seen from outside")

    def test_add_subdirectory_configures_without_a_trace(self):
        outside = self.folder / "inside"
        outside.mkdir()
        (outside / "CMakeLists.txt").write_text(
            "cmake_minimum_required(VERSION 3.22)\nproject(user LANGUAGES CXX)\n"
            f"add_subdirectory({ROOT} alidade EXCLUDE_FROM_ALL)\nadd_executable(user user.cpp)\n"
            "target_link_libraries(user PRIVATE alidade::alidade)\n"
            'if(CMAKE_CXX_FLAGS OR CMAKE_CXX_COMPILER_LAUNCHER OR ALIDADE_TESTS)\n'
            '  message(FATAL_ERROR "alidade changed its user: ${CMAKE_CXX_FLAGS} ${CMAKE_CXX_COMPILER_LAUNCHER}")\nendif()\n')
        (outside / "user.cpp").write_text("#include <alidade/alidade.h>\nint main() {}\n")
        run("cmake", "-S", outside, "-B", outside / "build")

    def test_man_pages_and_completion_are_there(self):
        self.assertTrue((self.prefix / "share/man/man1/alidade-calibrate.1").exists())
        self.assertIn("--board", (self.prefix / "share/bash-completion/completions/alidade").read_text())


if __name__ == "__main__":
    build = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main(verbosity=1)
