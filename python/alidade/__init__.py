"""Cameras that move: calibration and localisation, with the uncertainty of every value.

    import alidade as al
    r = al.calibrate("photos/*.jpg", board=al.Board("9x6", square_m=0.025))
    print(r.verdict.sentence, r.camera.fx, r.camera.sigma.fx)
    pixels = r.camera.project(points_in_cam)          # (..., 3) [m] -> (..., 2) [px]

Arrays are numpy's, float64, the last axis is the vector; NaN where there is no answer for an element. What is wrong with
the input is a ValueError in one line; what the data show never raises, it stands in `verdict`. Pixel (0, 0) is the centre
of the top-left pixel; camera axes: x right, y down, z forward; lengths [m], angles [rad].
"""
from . import plan, simulate, study
from ._alidade import Interrupted, __version__
from .board import Board, BoardDetection, BoardFinder, find_board
from .camera import Camera
from .errors import CannotDetermine, EstimateError, NoConvergence, NotTrusted
from .guides import CaptureGuide, ShotGuide, ViewGuide
from .head import Head
from .jobs import calibrate, corners, identify, localize, observe, project, rangefinder, reproduce, rig, servo, track
from .live import Localizer, Observer, Tracker
from .result import Check, Result, Verdict, read_result

__all__ = [
    "Board", "BoardDetection", "BoardFinder", "Camera", "CannotDetermine", "CaptureGuide", "Check", "EstimateError", "Head",
    "Interrupted", "Localizer", "NoConvergence", "NotTrusted", "Observer", "Result", "ShotGuide", "Tracker", "Verdict", "ViewGuide",
    "__version__", "calibrate", "corners", "find_board", "identify", "localize", "observe", "plan", "project",
    "rangefinder", "read_result", "reproduce", "rig", "servo", "simulate", "study", "track"]
