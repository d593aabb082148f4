"""Cameras against cv2 and mrcal in one interpreter, and as values."""
import copy
import pickle
import tempfile
import threading
import time
import unittest
import warnings

import cv2
import mrcal
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as some
from hypothesis.extra import numpy as some_arrays

import alidade as al

K = np.array([[533.2, 0.0, 321.4], [0.0, 531.8, 239.9], [0.0, 0.0, 1.0]])
DIST = np.array([-0.28, 0.07, 1e-3, -7e-4, 0.02])
SIZE = 640, 480
CAMERA = al.Camera.from_opencv(K, DIST, SIZE)


def points(count, seed=1):
    random = np.random.default_rng(seed)
    return np.stack([random.uniform(-0.5, 0.5, count), random.uniform(-0.4, 0.4, count), random.uniform(0.9, 4.0, count)], 1)


def cv_project(p):
    return cv2.projectPoints(p.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), K, DIST)[0].reshape(-1, 2)


class AgainstOthers(unittest.TestCase):
    def test_project_is_opencvs(self):
        p = points(2000)
        np.testing.assert_allclose(CAMERA.project(p), cv_project(p), rtol=0.0, atol=1e-9)

    def test_project_and_unproject_are_mrcals(self):
        intrinsics = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], *DIST])
        p = points(2000, seed=2)
        px, J_point, _ = CAMERA.project(p, jacobians=True)
        expected, expected_J_point, _ = mrcal.project(p, "LENSMODEL_OPENCV5", intrinsics, get_gradients=True)
        np.testing.assert_allclose(px, expected, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(J_point, expected_J_point, rtol=1e-9, atol=1e-7)
        # mrcal unprojects to about 1e-7 px: ours is held against its projection
        back = mrcal.project(CAMERA.unproject(px), "LENSMODEL_OPENCV5", intrinsics)
        np.testing.assert_allclose(back, px, rtol=0.0, atol=1e-9)

    def test_fisheye_is_opencvs(self):
        k = np.array([0.02, -0.004, 0.002, -0.0006])
        camera = al.Camera.from_opencv(K, k, SIZE, fisheye=True)
        p = points(500, seed=3)
        expected = cv2.fisheye.projectPoints(p.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), K, k)[0].reshape(-1, 2)
        np.testing.assert_allclose(camera.project(p), expected, rtol=0.0, atol=1e-9)
        np.testing.assert_array_equal(camera.to_opencv()[1], k)

    def test_lens_jacobian_is_a_difference_of_projections(self):
        p = points(20, seed=4)
        _, _, J = CAMERA.project(p, jacobians=True)
        values = dict(zip(CAMERA.parameter_names, CAMERA.parameters))
        for i, name in enumerate(CAMERA.parameter_names):
            step = 1e-6 * max(1.0, abs(values[name]))
            up, down = (al.Camera("brown", SIZE, **{**values, name: values[name] + s}) for s in (step, -step))
            np.testing.assert_allclose(J[..., i], (up.project(p) - down.project(p)) / (2 * step), rtol=1e-5, atol=1e-5)

    def test_undistort_is_opencvs_remap(self):
        image = np.random.default_rng(5).integers(0, 255, (480, 640), dtype=np.uint8)
        ours = CAMERA.undistort(image)
        new_K, _ = CAMERA.undistorted().to_opencv()
        theirs = cv2.undistort(image, K, DIST, None, new_K)
        self.assertLess(np.mean(np.abs(ours.astype(int) - theirs.astype(int))[10:-10, 10:-10] > 12), 0.02)

    def test_a_million_points_no_slower_than_opencv(self):
        p = points(1_000_000)
        column = p.reshape(-1, 1, 3)

        def seconds(work):
            times = []
            for _ in range(3):
                begin = time.perf_counter()
                work()
                times.append(time.perf_counter() - begin)
            return min(times)

        ours = seconds(lambda: CAMERA.project(p))
        theirs = seconds(lambda: cv2.projectPoints(column, np.zeros(3), np.zeros(3), K, DIST))
        self.assertLess(ours, theirs)


class Shapes(unittest.TestCase):
    def test_leading_axes_stay(self):
        p = points(24).reshape(2, 3, 4, 3)
        px = CAMERA.project(p)
        self.assertEqual(px.shape, (2, 3, 4, 2))
        self.assertEqual(CAMERA.unproject(px).shape, (2, 3, 4, 3))
        self.assertEqual([each.shape for each in CAMERA.project(p, jacobians=True)], [(2, 3, 4, 2), (2, 3, 4, 2, 3), (2, 3, 4, 2, 10)])
        self.assertEqual(CAMERA.project(p[0, 0, 0]).shape, (2,))
        self.assertEqual(CAMERA.project(np.zeros((0, 3))).shape, (0, 2))

    def test_any_layout_has_the_same_answer(self):
        p = points(60)
        expected = CAMERA.project(p)
        read_only = p.copy()
        read_only.flags.writeable = False
        for same in (np.asfortranarray(p), read_only, p.tolist(), np.repeat(p, 2, axis=0)[::2]):
            np.testing.assert_array_equal(CAMERA.project(same), expected)
        np.testing.assert_allclose(CAMERA.project(p.astype(np.float32)), expected, atol=1e-3)

    def test_no_answer_is_nan_for_that_point_alone(self):
        # a radial map that folds at r = 1.09
        camera = al.Camera.from_opencv(K, [-0.28, 0.0, 0.0, 0.0], SIZE)
        px = camera.project([[0.1, 0.0, 1.0], [0.0, 0.0, -1.0], [np.nan, 0.0, 1.0], [50.0, 0.0, 1.0]])
        self.assertEqual(np.isfinite(px).all(axis=1).tolist(), [True, False, False, False])
        self.assertTrue(np.isnan(CAMERA.unproject([np.nan, 1.0])).all())

    def test_wrong_input_is_one_clear_line(self):
        for wrong in ([1.0, 2.0], 3.0, np.zeros((2, 4)), [[1.0, 2.0, 3.0], [1.0]], ["a", "b", "c"], None,
                      np.zeros(3, dtype=complex), np.zeros(3, dtype=bool), object()):
            with self.subTest(wrong=wrong), self.assertRaises(ValueError) as caught:
                CAMERA.project(wrong)
            self.assertRegex(str(caught.exception), r"^points: .+")
            self.assertNotIn("\n", str(caught.exception))

    @settings(max_examples=150, deadline=None, database=None)
    @given(some_arrays.arrays(dtype=some.sampled_from([np.float64, np.float32, np.int16, np.uint8, np.complex64, np.bool_]),
                              shape=some_arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=4)))
    def test_any_array_is_answered_or_refused(self, array):
        for work, size in ((CAMERA.project, 3), (CAMERA.unproject, 2), (CAMERA.sigma_px, 2)):
            try:
                answer = work(array)
            except ValueError:
                continue
            self.assertEqual(array.shape[-1], size)
            self.assertEqual(answer.shape[:array.ndim - 1], array.shape[:-1])


class Values(unittest.TestCase):
    def setUp(self):
        root = np.random.default_rng(1).normal(size=(10, 10))
        self.known = al.Camera.from_opencv(K, DIST, SIZE, covariance=root @ root.T)

    def test_pickle_copy_and_compare(self):
        for same in (pickle.loads(pickle.dumps(self.known)), copy.copy(self.known), copy.deepcopy(self.known)):
            self.assertEqual(same, self.known)
            np.testing.assert_array_equal(same.covariance, self.known.covariance)
        self.assertNotEqual(self.known, CAMERA)
        self.assertEqual(hash(CAMERA), hash(pickle.loads(pickle.dumps(CAMERA))))

    def test_names_sigma_and_opencv(self):
        self.assertEqual(self.known.parameter_names, ["fx", "fy", "cx", "cy", "skew", "k1", "k2", "p1", "p2", "k3"])
        self.assertEqual(self.known.k3, 0.02)
        self.assertAlmostEqual(self.known.sigma.fx, self.known.covariance[0, 0] ** 0.5)
        back = al.Camera.from_opencv(*self.known.to_opencv(), SIZE)
        self.assertEqual(back, CAMERA)
        with self.assertRaises(AttributeError):
            self.known.k9
        self.assertIsNone(CAMERA.covariance)
        self.assertTrue(np.isnan(CAMERA.sigma.fx))

    def test_a_covariance_without_skew_is_opencvs(self):
        root = np.random.default_rng(2).normal(size=(9, 9))
        camera = al.Camera.from_opencv(K, DIST, SIZE, covariance=root @ root.T)
        at = [camera.parameter_names.index(name) for name in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")]
        np.testing.assert_array_equal(camera.covariance[np.ix_(at, at)], root @ root.T)
        self.assertEqual(camera.sigma.skew, 0.0)

    def test_files_of_every_format(self):
        with tempfile.TemporaryDirectory() as folder:
            for name in ("alidade", "opencv", "ros", "mrcal"):
                self.known.write(f"{folder}/camera", name)
                np.testing.assert_array_equal(al.Camera.read(f"{folder}/camera").parameters, CAMERA.parameters)
            with self.assertRaisesRegex(ValueError, "k3"):
                self.known.write(f"{folder}/camera", "kalibr")
            with self.assertRaisesRegex(ValueError, "absent.yaml"):
                al.Camera.read(f"{folder}/absent.yaml")

    def test_four_coefficients_of_opencv_are_asked_about(self):
        matrix = "{{rows: {}, cols: {}, dt: d, data: {}}}"
        text = (f"%YAML:1.0\n---\nimage_width: 160\nimage_height: 120\ncamera_matrix: !!opencv-matrix "
                f"{matrix.format(3, 3, [90, 0, 80, 0, 90, 60, 0, 0, 1])}\ndistortion_coefficients: !!opencv-matrix "
                f"{matrix.format(4, 1, [0.02, 0.01, -0.004, 0.001])}\n")
        with tempfile.TemporaryDirectory() as folder:
            with open(f"{folder}/c.yml", "w") as file:
                file.write(text)
            with self.assertWarnsRegex(UserWarning, "k1 k2 k3 k4 of cv::fisheye.*c.yml:fisheye, or .*c.yml:brown"):
                self.assertEqual(al.Camera.read(f"{folder}/c.yml").model, "brown")
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                self.assertEqual(al.Camera.read(f"{folder}/c.yml:fisheye").model, "kannala_brandt")

    def test_a_file_is_read_not_constructed(self):
        import pathlib
        for file in ("out/camera.yaml", pathlib.Path("camera.yml")):
            with self.assertRaisesRegex(ValueError, "al.Camera.read"):
                al.Camera(file)

    def test_wrong_values_are_refused(self):
        for work in (lambda: al.Camera("lens", SIZE), lambda: al.Camera("brown", SIZE, k9=1.0),
                     lambda: al.Camera("brown", SIZE, fx=np.nan), lambda: al.Camera("brown", "640"),
                     lambda: al.Camera.from_opencv(np.eye(4), DIST, SIZE), lambda: al.Camera.from_opencv(-K, DIST, SIZE),
                     lambda: al.Camera.from_opencv(K, DIST[:3], SIZE), lambda: al.Camera.from_opencv(K, DIST, (0, 1)),
                     lambda: al.Camera.from_opencv(K + [[0, 0, 0], [0, 0, 0], [1, 0, 0]], DIST, SIZE),
                     lambda: al.Camera.from_opencv(K + [[0, 0, 0], [1, 0, 0], [0, 0, 0]], DIST, SIZE),
                     lambda: al.Camera.from_opencv(K + [[0, 5, 0], [0, 0, 0], [0, 0, 0]], DIST, SIZE),
                     lambda: al.Camera("pinhole", SIZE, fx=1.0, fy=1.0, skew=5.0).to_opencv(),
                     lambda: al.Camera.from_opencv(K, DIST, SIZE, np.eye(3)), lambda: al.Camera.from_opencv(K, [1.0] * 8, SIZE)):
            with self.assertRaises(ValueError):
                work()

    def test_sigma_needs_a_covariance_and_falls_with_it(self):
        self.assertTrue(np.isnan(CAMERA.sigma_px([320.0, 240.0])))
        half = al.Camera.from_opencv(K, DIST, SIZE, covariance=0.25 * self.known.covariance)
        px = [[320.0, 240.0], [10.0, 10.0]]
        np.testing.assert_allclose(half.sigma_px(px), 0.5 * self.known.sigma_px(px), rtol=1e-9)

    def test_eight_threads_have_the_same_answers(self):
        p = points(50_000)
        expected, answers = CAMERA.project(p), [None] * 8

        def work(i):
            answers[i] = [CAMERA.project(p) for _ in range(4)]

        threads = [threading.Thread(target=work, args=(i,)) for i in range(8)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        for answer in (each for several in answers for each in several):
            np.testing.assert_array_equal(answer, expected)

    def test_ten_thousand_calls_leave_nothing(self):
        p = points(100)

        def resident():
            with open("/proc/self/statm") as file:
                return int(file.read().split()[1]) * 4096

        def calls(count):
            for _ in range(count):
                CAMERA.unproject(CAMERA.project(p, jacobians=True)[0])
                al.Camera.from_opencv(K, DIST, SIZE).text()

        calls(1000)
        before = resident()
        calls(10_000)
        self.assertLess(resident() - before, 2 << 20)


if __name__ == "__main__":
    unittest.main()
