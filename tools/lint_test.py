#!/usr/bin/env python3
"""The lints fail on what they forbid, and only on that."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

TOOLS = pathlib.Path(__file__).parent


def outcome(script, files):
    """Exit code and output of a lint run on a folder that holds `files` {path: text}."""
    with tempfile.TemporaryDirectory() as folder:
        for path, text in files.items():
            file = pathlib.Path(folder) / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
        done = subprocess.run([sys.executable, TOOLS / script, folder], capture_output=True, text=True, check=False)
        return done.returncode, done.stdout.replace(folder + "/", "")


class Layers(unittest.TestCase):
    def assert_refused(self, path, text, message):
        self.assertEqual(outcome("check_layers.py", {path: text}), (1, message + "\n"))

    def test_folders_around_the_library_have_their_table(self):
        with tempfile.TemporaryDirectory() as folder:
            tree = pathlib.Path(folder)
            for path, text in {"src/alidade/geometry/a.h": "", "examples/01.cpp": '#include "alidade/files/csv.h"\n',
                               "cli/app/a.cpp": '#include "cli/commands/commands.h"\n', "elsewhere/b.cpp": ""}.items():
                (tree / path).parent.mkdir(parents=True, exist_ok=True)
                (tree / path).write_text(text)
            done = subprocess.run([sys.executable, TOOLS / "check_layers.py", tree / "src/alidade"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertEqual(done.stdout.splitlines(), ["cli/app/a.cpp:1: cli/app/ may not include cli/commands/",
                                                    "elsewhere/: is not in the table OUTSIDE",
                                                    "examples/01.cpp:1: examples/ may not include alidade/files/"])

    def test_arrows_point_one_way(self):
        self.assert_refused("geometry/a.h", '#include "alidade/camera/camera.h"\n', "geometry/a.h:1: geometry/ may not include camera/")
        self.assert_refused("camera/a.cpp", '\n#include "alidade/files/csv.h"\n', "camera/a.cpp:2: camera/ may not include files/")
        self.assert_refused("calibrate/a.cpp", '#include "alidade/simulate/x.h"\n', "calibrate/a.cpp:1: calibrate/ may not include simulate/")
        self.assert_refused("simulate/a.cpp", '#include "alidade/calibrate/x.h"\n', "simulate/a.cpp:1: simulate/ may not include calibrate/")

    def test_a_public_header_is_of_its_room(self):
        self.assert_refused("calibrate.h", '#include "alidade/rig/x.h"\n', "calibrate.h:1: calibrate.h/ may not include rig/")

    def test_an_unknown_folder_is_refused(self):
        self.assert_refused("utils/a.h", "", "utils/a.h: folder 'utils' is not in the table")

    def test_heavy_headers_stay_out_of_headers(self):
        self.assert_refused("imaging/a.h", "#include <opencv2/core.hpp>\n", "imaging/a.h:1: opencv2 belongs in a .cpp")

    def test_only_io_meets_the_outside_world(self):
        self.assert_refused("calibrate/a.cpp", "#include <iostream>\n", "calibrate/a.cpp:1: only what reads and writes, live/ and cli/ may use iostream")
        self.assert_refused("imaging/a.cpp", "cv::imread(name);\n", "imaging/a.cpp:1: only what reads and writes, live/ and cli/ may use imread")

    def test_a_folder_fits_on_a_screen(self):
        files = {f"geometry/{name}.h": "" for name in "abcdefghijklm"}
        self.assertEqual(outcome("check_layers.py", files), (1, "geometry/: 13 headers, at most 12\n"))
        self.assertEqual(outcome("check_layers.py", {f"testing/{name}.h": "" for name in "abcdefghijklm"})[0], 0)

    def test_sizes_hold(self):
        self.assert_refused("geometry/a.cpp", "\n" * 401, "geometry/a.cpp: 401 lines; a file has at most 400")
        includes = "".join(f'#include "alidade/geometry/h{i}.h"\n' for i in range(13))
        self.assert_refused("camera/a.cpp", includes, "geometry/: other folders include 13 of its headers, at most 12 may be")

    def test_what_is_drawn_is_allowed(self):
        files = {
            "camera/a.h": '#include "alidade/geometry/x.h"\n#include "alidade/camera/y.h"\n',
            "calibrate/a.cpp": '#include "alidade/board/x.h"\n#include <opencv2/core.hpp>\n',
            "calibrate/a_test.cpp": '#include "alidade/simulate/x.h"\n#include <thread>\n',
            "calibrate.h": '#include "alidade/calibrate/x.h"\n#include "alidade/board/x.h"\n',
            "files.h": '#include "alidade/files/x.h"\n',
            "tables/a.cpp": '#include "alidade/calibrate/x.h"\n#include <cstdio>\n',
        }
        self.assertEqual(outcome("check_layers.py", files), (0, "layers ok (6 files)\n"))


class Names(unittest.TestCase):
    def test_a_type_is_defined_once(self):
        files = {"a/x.h": "struct Fit {\n", "b/y.h": "struct Fit final : Base {\n", "b/z.h": "struct Other;\nenum class Kind { one };\n"}
        code, said = outcome("check_names.py", files)
        self.assertEqual(code, 1)
        self.assertIn("Fit is defined in", said)
        self.assertNotIn("Kind", said)
        self.assertEqual(outcome("check_names.py", {"a/x.h": "struct Fit {\n", "testing/y.h": "struct Fit {\n"})[0], 0)


class Docs(unittest.TestCase):
    FILES = {"src/alidade/a/b_test.cpp": "TEST(Suite, OneThing) {\n", "src/alidade/a/b.cpp": "", "other.md": "# A heading, here\n"}

    def assert_refused(self, line, fault):
        self.assertEqual(outcome("check_docs.py", {**self.FILES, "docs/page.md": line}), (1, f"docs/page.md:1: {fault}\n"), line)

    def assert_allowed(self, line):
        self.assertEqual(outcome("check_docs.py", {**self.FILES, "docs/page.md": line})[0], 0, line)

    def test_links_lead_somewhere(self):
        self.assert_refused("[x](gone.md)", "links to gone.md, which is not there")
        self.assert_refused("[x](../other.md#a-word)", "links to #a-word, which other.md does not have")
        self.assert_allowed("[x](../other.md#a-heading-here) and [y](https://example.com/gone.md)")

    def test_files_are_there(self):
        self.assert_refused("see `a/c.cpp`", "names a/c.cpp, which is not there")
        self.assert_allowed("see `a/b.cpp`, `b.cpp`, `x_test.cpp`, `ROOM.h`, `out/track.csv`")

    def test_tests_are_there(self):
        self.assert_refused("`Suite.Another`", "names the test Suite.Another, which is not there")
        self.assert_refused("`…Another…`", "names the test …Another…, which is not there")
        self.assert_allowed("`Suite.OneThing`, `Suite.*`, `Suite.One…`, `…Thing…`, `Other.Word`")

    def test_options_are_of_their_command(self):
        with tempfile.TemporaryDirectory() as folder:
            program = pathlib.Path(folder) / "alidade"
            program.write_text("#!/bin/sh\ncase $1 in go) echo '  --fast N';; *) printf 'Subcommands:\\n  go   Goes\\n';; esac\n")
            program.chmod(0o755)
            (pathlib.Path(folder) / "page.md").write_text("`alidade go x --fast 3` and `alidade go --faster`\n")
            done = subprocess.run([sys.executable, TOOLS / "check_docs.py", folder, program], capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, done.stdout), (1, "page.md:1: alidade go has no --faster\n"))


class Frames(unittest.TestCase):
    def assert_refused(self, line, message):
        self.assertEqual(outcome("check_frames.py", {"a.cpp": line}), (1, f"a.cpp:1: {message}\n"), line)

    def assert_allowed(self, line):
        self.assertEqual(outcome("check_frames.py", {"a.cpp": line})[0], 0, line)

    def test_inner_names_must_cancel(self):
        self.assert_refused("x = cam_from_world * board_from_world;", "frames do not cancel: cam_from_world * board_from_world")
        self.assert_refused("f(cam_from_board * point_in_cam);", "frames do not cancel: cam_from_board * a point in cam")
        self.assert_refused("a.cam_from_world * b[i].board_from_cam", "frames do not cancel: cam_from_world * board_from_cam")
        self.assert_refused("cam_from_world.rotation * ray_in_cam", "frames do not cancel: cam_from_world * a point in cam")
        self.assert_refused("cam_from_board.inverse() * point_in_board", "frames do not cancel: board_from_cam * a point in board")
        self.assert_refused("base_from_head(pan_rad, tilt_rad) * cam_from_head", "frames do not cancel: base_from_head * cam_from_head")
        self.assert_refused("a_from_b * b_from_c * b_from_d", "frames do not cancel: b_from_c * b_from_d")

    def test_outer_names_must_be_the_result(self):
        self.assert_refused("const Rigid3 board_from_cam = cam_from_world * world_from_board;", "board_from_cam is assigned cam_from_board")
        self.assert_refused("const Vec point_in_world = cam_from_world * point_in_world;", "world is assigned cam")

    def test_a_column_has_the_frame_of_its_value(self):
        self.assert_refused('add(table, "target_in_base_", "_m", std::move(target_in_world));',
                            'column "target_in_base_" holds a point in world')
        self.assert_refused('estimate["point_in_cam_m"] = numbers(ray.origin_in_world);',
                            'column "point_in_cam_m" holds a point in world')
        self.assert_allowed('add(table, "target_in_world_", "_m", std::move(target_in_world));')
        self.assert_allowed('estimate["rms_in_sigmas"] = rms(point_in_world);')

    def test_products_that_cancel_are_allowed(self):
        self.assert_allowed("const Rigid3 cam_from_board = cam_from_world * world_from_board;")
        self.assert_allowed("const Vec point_in_cam = view.cam_from_board * point_in_board;")
        self.assert_allowed("const Vec point_in_board = cam_from_board.inverse() * point_in_cam;")
        self.assert_allowed("const Vec point_in_cam = cam_from_board * points_in_board[i];")
        self.assert_allowed("const Vec offset = cam_from_board * point_in_board - true_cam_from_board * point_in_board;")
        self.assert_allowed("x = cam_from_world * 2.0;  // board_from_world * point_in_cam")


if __name__ == "__main__":
    unittest.main()
