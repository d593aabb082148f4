"""Each room's page begins with the same job as command, C++ and Python: the two that can be run here give the same answer, and the
lines of C++ compile."""
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import unittest

import numpy as np

import alidade as al
from common import EXECUTABLE, InFolder, command

ROOT = pathlib.Path(__file__).resolve().parents[2]
SIMULATED = {
    "board-calibration": ["board --board 9x6 --square 0.025 --photos 7 --size 640x480 --out photos"],
    "rotating-camera": ["rotation --source head --duration 6 --out ."],
    "turned-photos": ["rotation --photos 4 --size 640x480 --out ."],
    "rangefinder": ["rangefinder --photos --shots 7 --out ."],
    "pan-tilt-heads": ["rig --out ."],
    "tracking": ["track --scenario B --out ."],
    "servo": ["servo --out ."],
    "localization": ["underwater --frames 30 --out ."],
}
# What a program has that uses the lines: of a camera, of a head.
BEFORE = {"rotating-camera": "double t_s = 0.0; Eigen::Vector3d pan_tilt_roll; std::vector<Eigen::Vector2d> pixels; alidade::ObserveConfig config;",
          "capture": "double t_s = 0.0; extern const cv::Mat& image;"}


def page_of(name):
    place = ROOT / "docs" / f"{name}.md"
    text = (place if place.exists() else ROOT / "docs" / "maths" / f"{name}.md").read_text()
    return text.split("\n## ")[0]


def code_of(page, language):
    return re.search(rf"^```{language}\n(.*?)^```", page, re.M | re.S)[1]


def differences(one, other, path=""):
    """Numbers that differ by more than the last digits, of two trees of the same shape."""
    if isinstance(one, dict) and isinstance(other, dict):
        return [fault for key in one.keys() | other.keys() for fault in differences(one.get(key), other.get(key), f"{path}.{key}")]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        return [fault for i, (a, b) in enumerate(zip(one, other)) for fault in differences(a, b, f"{path}[{i}]")]
    if isinstance(one, float) and isinstance(other, float):
        return [] if math.isclose(one, other, rel_tol=1e-9, abs_tol=1e-12) else [f"{path}: {one} {other}"]
    return [] if one == other else [f"{path}: {one} {other}"]


def saw_a_target(folder):
    """Three cameras that stand still, with clocks of their own, and a target that goes all three ways; sights.csv, gnss.csv."""
    random = np.random.default_rng(4)
    camera = al.Camera("pinhole", (1280, 720), fx=900.0, fy=900.0, cx=640.0, cy=360.0)
    path = lambda t: np.stack([6 * np.sin(0.5 * t), 2 * np.sin(0.83 * t) - 1, 22 + 5 * np.cos(0.37 * t)], -1)
    rows = []
    for head, (place, turn, offset) in enumerate((((0, 0, 0), 0.0, 0.0), ((8, 0, 1), 0.3, 3.2), ((-7, 1, 2), -0.3, -5.1)), 1):
        t = np.arange(0.0, 60.0, 0.1) + 0.01 * head
        world_from_cam = np.array([[math.cos(turn), 0, -math.sin(turn)], [0, 1, 0], [math.sin(turn), 0, math.cos(turn)]])
        px = camera.project((path(t) - place) @ world_from_cam) + random.normal(0, 0.3, (len(t), 2))
        seen = np.isfinite(px).all(1) & (px > 0).all(1) & (px < camera.size).all(1)
        rows += [(when + offset, head, *at) for when, at in zip(t[seen], px[seen])]
        camera.write(folder / f"{'abc'[head - 1]}.yaml")
    (folder / "sights.csv").write_text("t_capture_s,head,u_px,v_px\n" + "".join(f"{t},{head},{u},{v}\n" for t, head, u, v in sorted(rows)))
    t = np.arange(0.0, 60.0, 0.5)
    (folder / "gnss.csv").write_text("t_s,x_m,y_m,z_m\n" + "".join(f"{when},{x},{y},{z}\n" for when, (x, y, z) in zip(t, path(t))))


class Pages(InFolder):
    def job(self, name):
        folder = self.folder / name
        folder.mkdir()
        for words in SIMULATED.get(name, []):
            done = subprocess.run([EXECUTABLE, "simulate", *words.split(), "--quiet"], cwd=folder, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
        if name == "fixed-cameras":
            saw_a_target(folder)
        if name == "servo":  # one run of each controller, and no grid
            text = (folder / "scenario.yaml").read_text()
            for key, short in (("seeds: .*", "seeds: 1"), ("duration_s: .*", "duration_s: 4"), ("robustness: .*", "robustness: {points: 0}")):
                text = re.sub(f"(?m)^{key}", short, text)
            (folder / "scenario.yaml").write_text(text)
        page = page_of(name)
        line = re.search(r"(?m)^    alidade (.*)$", page)[1]
        done = subprocess.run(f"{EXECUTABLE} {line} --out command --quiet --no-report", shell=True, cwd=folder, capture_output=True, text=True)
        self.assertIn(done.returncode, (0, 6), f"{line}: {done.stderr}")
        values = {"al": al}
        before = pathlib.Path.cwd()
        os.chdir(folder)
        try:
            exec(code_of(page, "python"), values)
        finally:
            os.chdir(before)
        document = json.loads((folder / "command" / "result.json").read_text())
        self.assertEqual(differences(document["estimate"], json.loads(json.dumps(values["r"].estimate))), [], name)
        self.assertEqual(document["verdict"]["sentence"], values["r"].verdict.sentence)
        shutil.rmtree(folder)

    def test_command_and_python_have_the_same_answer(self):
        for name in [*SIMULATED, "fixed-cameras"]:
            with self.subTest(page=name):
                self.job(name)

    def test_the_lines_of_cpp_compile(self):
        names = [*SIMULATED, "fixed-cameras", "capture"]
        text = "#include <alidade/alidade.h>\n\n#include <cstdio>\n"
        for name in names:
            code = re.sub(r"(?m)^#include.*$", "", code_of(page_of(name), "cpp"))
            text += f"void {name.replace('-', '_')}() {{\n{BEFORE.get(name, '')}\n{code}}}\n"
        source = self.folder / "pages.cpp"
        source.write_text(text)
        done = subprocess.run(["c++", "-std=c++20", "-fsyntax-only", "-I", str(ROOT / "src"), "-I", "/usr/include/eigen3", str(source)], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr[-3000:])

    def test_heads_are_asked(self):
        exec(code_of(page_of("heads"), "python"), {"al": al})


if __name__ == "__main__":
    unittest.main()
