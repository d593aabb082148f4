"""What the tests share: the executable, simulated views of a board, a folder that goes."""
import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy as np

import alidade as al

EXECUTABLE = os.environ.get("ALIDADE_EXECUTABLE", "alidade")
BOARD = al.Board("9x6", square_m=0.025)
TRUE_CAMERA = al.Camera("brown", (640, 480), fx=533.0, fy=534.0, cx=320.5, cy=238.5, k1=-0.28, k2=0.09, p1=1e-3, p2=-5e-4)


def rotation(vector):
    """Rodrigues."""
    angle = np.linalg.norm(vector)
    axis = np.asarray(vector) / angle
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def board_corners(num_views=14, sigma_px=0.2, seed=1, camera=TRUE_CAMERA, board=BOARD):
    """Corners (N, P, 2) of boards all over the image, with noise."""
    random = np.random.default_rng(seed)
    centred = board.points - board.points.mean(axis=0)
    views = []
    while len(views) < num_views:
        place = np.array([random.uniform(-0.1, 0.1), random.uniform(-0.08, 0.08), random.uniform(0.3, 0.5)])
        pixels = camera.project(centred @ rotation(random.uniform(-0.6, 0.6, 3)).T + place)
        inside = np.isfinite(pixels).all() and (pixels > 0).all() and (pixels < camera.size).all()
        if inside:
            views.append(pixels + random.normal(0.0, sigma_px, pixels.shape))
    return np.array(views)


def assert_same_table(one, other, name=""):
    """Structured arrays column by column: NaN is NaN."""
    assert one.dtype.names == other.dtype.names, (name, one.dtype.names, other.dtype.names)
    for column in one.dtype.names:
        np.testing.assert_array_equal(one[column], other[column], f"{name}.{column}")


def command(*words):
    """Runs the executable; its completed process."""
    return subprocess.run([EXECUTABLE, *map(str, words)], capture_output=True, text=True)


class InFolder(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls._held = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls._held.name)

    @classmethod
    def tearDownClass(cls):
        cls._held.cleanup()
