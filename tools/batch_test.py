#!/usr/bin/env python3
"""alidade batch: each row is the same as its command alone, a row's failure is its row's, and a stopped lot goes on.

    tools/batch_test.py build/release/alidade
"""
import csv
import json
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

ALIDADE = pathlib.Path(sys.argv.pop(1)).resolve()
CAMERAS = 10


class Batch(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.made = pathlib.Path(tempfile.mkdtemp())
        for i in range(CAMERAS):
            more = ["--intrinsics", "760,750,390,290"] if i == 7 else []
            subprocess.run([ALIDADE, "simulate", "rotation", "--source", "head", "--duration", "4", "--seed", str(i), *more,
                            "--out", cls.made / f"cam {i}", "--quiet", "--no-report"], check=True)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.made)

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)
        rows = [f'cam {i},"observe ""{self.made}/cam {i}/log.csv""",780x582' for i in range(CAMERAS)]
        rows += [f"gone,observe {self.made}/nowhere.csv,", "odd,observe --nonsense,", "endless,view,", f"out,observe {self.made}/x --out y,"]
        (self.folder / "jobs.csv").write_text("camera,arguments,size\n" + "\n".join(rows) + "\n")

    def run_batch(self, *more, code=0):
        done = subprocess.run([ALIDADE, "batch", "jobs.csv", "--out", "lot", "--quiet", *more], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(done.returncode, code, done.stderr)
        return done.stderr

    def table(self):
        with open(self.folder / "lot/batch.csv", newline="") as file:
            return list(csv.DictReader(file))

    def test_rows_are_their_commands(self):
        self.run_batch()
        rows = self.table()
        self.assertEqual([row["camera"] for row in rows], [*(f"cam {i}" for i in range(CAMERAS)), "gone", "odd", "endless", "out"])
        self.assertEqual([int(row["exit_code"]) for row in rows], [0] * CAMERAS + [3, 2, 2, 2], [row["sentence"] for row in rows])
        self.assertIn("nowhere.csv", rows[CAMERAS]["sentence"])
        self.assertIn("--nonsense", rows[CAMERAS + 1]["sentence"])
        for i in (0, 7):
            subprocess.run([ALIDADE, "observe", self.made / f"cam {i}/log.csv", "--size", "780x582", "--out", self.folder / "alone", "--quiet"], check=True)
            alone = json.loads((self.folder / "alone/result.json").read_text())
            self.assertEqual(float(rows[i]["fx"]), alone["estimate"]["camera"]["fx"])
            self.assertEqual(float(rows[i]["sigma_fx"]), alone["stddev"]["camera"]["fx"])
            self.assertEqual(rows[i]["verdict"], alone["verdict"]["state"])
            in_lot = self.folder / "lot" / rows[i]["folder"]
            self.assertEqual((in_lot / "intrinsics.csv").read_bytes(), (self.folder / "alone/intrinsics.csv").read_bytes())
        result = json.loads((self.folder / "lot/result.json").read_text())
        outliers = list(zip(result["data"]["outliers"]["camera"], result["data"]["outliers"]["quantity"]))
        self.assertIn(("cam 7", "camera.fx"), outliers)
        self.assertEqual({camera for camera, name in outliers if name == "camera.fx"}, {"cam 7"})
        values = result["data"]["values"]  # what the figure of the page draws: every value of the lot
        self.assertEqual(values["quantity"].count("camera.fx"), CAMERAS)
        self.assertEqual({values["camera"][i] for i, z in enumerate(values["z"]) if abs(z) > 4 and values["quantity"][i] == "camera.fx"}, {"cam 7"})
        self.assertEqual(result["counts"]["given"], CAMERAS + 4)

    def test_what_only_prints_is_no_result(self):
        (self.folder / "jobs.csv").write_text("camera,arguments\n" + "".join(
            f"c,{words}\n" for words in ("calibrate --help", "help calibrate", "simulate rotation --version", "schema observe", f"observe {self.made}/cam 0/log.csv -h")))
        self.run_batch(code=4)
        self.assertEqual([(row["exit_code"], row["verdict"]) for row in self.table()], [("2", "failed")] * 5)

    def test_rows_of_an_earlier_list_go(self):
        self.run_batch()
        (self.folder / "lot/rows/mine").mkdir()
        (self.folder / "lot/rows/mine/notes.txt").write_text("not a row")
        (self.folder / "jobs.csv").write_text(f'camera,arguments,size\nonly,"observe ""{self.made}/cam 1/log.csv""",780x582\n')
        self.run_batch()
        self.assertEqual(sorted(path.name for path in (self.folder / "lot/rows").iterdir()), ["000001-only", "mine"])

    def test_shards_and_a_stopped_lot_go_on(self):
        self.run_batch("--shard", "1/2")
        self.assertFalse((self.folder / "lot/batch.csv").exists())
        line = [ALIDADE, "batch", "jobs.csv", "--out", "lot", "--resume", "--threads", "1"]
        running = subprocess.Popen(line, cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        time.sleep(0.3)
        running.send_signal(signal.SIGTERM)
        said = running.communicate()[1]
        if running.returncode != 0:
            self.assertEqual(running.returncode, 143)
            self.assertIn("--resume", said)
        stamps = {file: file.stat().st_mtime_ns for file in self.folder.glob("lot/rows/*/row.json")}
        self.assertGreaterEqual(len(stamps), (CAMERAS + 4) // 2)
        self.run_batch("--resume")
        self.assertEqual(len(self.table()), CAMERAS + 4)
        for file, stamp in stamps.items():
            self.assertEqual(file.stat().st_mtime_ns, stamp, file)

    def test_what_a_stopped_lot_says_is_there(self):
        quick = f'quick,"observe ""{self.made}/cam 1/log.csv"" --size 780x582"'
        slow = "slow,head sim:// --identify --move"  # half a minute of a head
        for rows, folders, said in (([slow], 0, "before a row was done"), ([quick, slow], 1, "1 row is in")):
            (self.folder / "jobs.csv").write_text("camera,arguments\n" + "\n".join(rows) + "\n")
            running = subprocess.Popen([ALIDADE, "batch", "jobs.csv", "--out", f"stopped{folders}", "--threads", "1"], cwd=self.folder,
                                       stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            begin = time.monotonic()
            while len(list(self.folder.glob(f"stopped{folders}/rows/*/row.json"))) < folders and time.monotonic() - begin < 20:
                time.sleep(0.01)
            time.sleep(1.0)
            running.send_signal(signal.SIGTERM)
            words = running.communicate()[1]
            self.assertEqual(running.returncode, 143, words)
            self.assertIn(said, words)
            self.assertEqual("--resume" in words, folders > 0, words)
            self.assertEqual(len(list(self.folder.glob(f"stopped{folders}/rows/*/row.json"))), folders)

    def test_an_upgrade_in_the_middle_of_a_lot(self):
        own = self.folder / "alidade"
        shutil.copy2(ALIDADE, own)
        running = subprocess.Popen([own, "batch", "jobs.csv", "--out", "lot", "--threads", "1", "--quiet"], cwd=self.folder)
        while not list(self.folder.glob("lot/rows/*/row.json")):
            self.assertIsNone(running.poll())
            time.sleep(0.005)
        shutil.copy2(ALIDADE, self.folder / "newer")
        (self.folder / "newer").replace(own)  # as packages are: the file that runs is gone
        self.assertEqual(running.wait(), 0)
        self.assertEqual([int(row["exit_code"]) for row in self.table()], [0] * CAMERAS + [3, 2, 2, 2])

    def test_a_row_that_says_no_command_fails_alone(self):
        (self.folder / "jobs.csv").write_text('arguments,camera\n"",x\n"camera show none.yaml",y\n"observe \'z",z\n')
        self.run_batch(code=4)
        self.assertEqual([int(row["exit_code"]) for row in self.table()], [2, 3, 2])

    def test_a_table_that_cannot_be_is_refused(self):
        for text, said in (("camera,size\na,1x1\n", "arguments"), ("arguments\n", "no rows"), ('arguments\n"observe \'x"\n', "jobs.csv:2"), ('arguments,camera\n"",x\n', "empty")):
            (self.folder / "jobs.csv").write_text(text)
            self.assertIn(said, self.run_batch(code=3))
        self.assertFalse((self.folder / "lot/batch.csv").exists())


if __name__ == "__main__":
    unittest.main(verbosity=1)
