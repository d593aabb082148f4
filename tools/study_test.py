#!/usr/bin/env python3
"""alidade study: study.json is the same bytes for every number of threads, ranks and shards, and after a kill.

    tools/study_test.py build/release/alidade Study|Ranks

Ranks run by mpirun in a network namespace that has the loopback alone: mpirun listens on every address. Without mpirun,
alidade-study or the right to make such a namespace those tests are skipped (77).
"""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

ALIDADE = pathlib.Path(sys.argv.pop(1)).resolve()
STUDY = ALIDADE.with_name("alidade-study")
# The call that works, as root too, with more ranks than cores.
MPIRUN = ["unshare", "-n" if os.geteuid() == 0 else "-rn", "sh", "-c", "ip link set lo up && exec \"$@\"", "sh", "mpirun", "--allow-run-as-root", "--oversubscribe",
          "--bind-to", "none", "--mca", "btl", "self,vader", "--mca", "plm_rsh_agent", ""]
WHAT = ["observe", "--trials", "3000", "--seed", "9", "--quiet", "--no-report"]
SMALL = ["--block", "100"]


def why_no_ranks():
    for program in ("mpirun", "unshare", "ip"):
        if not shutil.which(program):
            return f"no {program}"
    if not STUDY.exists():
        return "built without MPI"
    tried = subprocess.run([*MPIRUN, "-n", "1", "true"], capture_output=True, text=True)
    return "" if tried.returncode == 0 else f"mpirun does not run here: {tried.stderr.strip()[-200:]}"


class Folder(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)

    def run_line(self, *words, code=0):
        done = subprocess.run([str(word) for word in words], capture_output=True, text=True, cwd=self.folder)
        self.assertEqual(done.returncode, code, f"{words}: {done.stdout[-500:]} {done.stderr[-1500:]}")
        return done.stderr

    def study(self, out, *more, what=WHAT):
        self.run_line(ALIDADE, "study", *what, *more, "--out", out)
        return (self.folder / out / "study.json").read_bytes()


class Study(Folder):
    def test_threads_blocks_and_runs_make_no_difference(self):
        one = self.study("one", "--threads", 1)
        for more in (("--threads", 2), ("--threads", 7, *SMALL), ("--block", 1), ("--block", 1000000), ("--threads", 2, *SMALL)):
            self.assertEqual(self.study("other", *more), one, more)
        self.assertNotEqual(self.study("other", what=[*WHAT[:3], "--seed", "10"]), one)

    def test_the_document_has_what_was_promised(self):
        document = json.loads(self.study("one"))
        self.assertEqual(list(document), ["schema", "study", "seed", "settings", "estimate"])
        self.assertEqual(document["seed"], 9)
        estimate = document["estimate"]
        self.assertEqual(estimate["trials"], 3000)
        self.assertEqual(list(estimate["quantities"]), ["fx", "fy", "cx", "cy"])
        for name, one in estimate["quantities"].items():
            self.assertLess(abs(one["bias"]), 0.1 * one["rms"], name)
            self.assertAlmostEqual(one["rms_over_bound"], 1.0, delta=3 / 6000**0.5 * 1.2)
            self.assertAlmostEqual(one["coverage"]["2"], 0.954, delta=0.015)
        self.assertEqual(len(estimate["worst"]), 10)

    def test_too_few_trials_are_not_good(self):
        # Inside 1σ: 3 √(0.6827 · 0.3173 / n) ≤ 0.04 from n = 1219 on; 2σ, 3σ and the RMS need fewer.
        for trials, state, says in ((5, "care", "too few to tell"), (1218, "care", "too few to tell"), (1219, "good", "σ covers them"), (3000, "good", "σ covers them")):
            self.study("one", what=["observe", "--trials", trials, "--seed", "9", "--quiet", "--no-report"])
            verdict = json.loads((self.folder / "one/result.json").read_text())["verdict"]
            self.assertEqual(verdict["state"], state, verdict)
            self.assertIn(says, verdict["sentence"])
            self.assertEqual(verdict["exit_code"], 0)
            if state == "care":
                self.assertIn("--trials 1219", verdict["to_add"])

    def test_shards_merge_to_the_same_bytes(self):
        whole = self.study("whole")
        for shards in (1, 2, 64):
            parts = [f"part-{shards}-{i}" for i in range(shards)]
            for i, part in enumerate(parts):
                self.run_line(ALIDADE, "study", *WHAT, "--shard", f"{i}/{shards}", "--out", part)
            self.run_line(ALIDADE, "study", "merge", *reversed(parts), "--out", "merged", "--quiet")
            self.assertEqual((self.folder / "merged/study.json").read_bytes(), whole, shards)

    def test_a_curve_shards_as_well(self):
        what = ["calibrate", "--trials", "20", "--vary", "photos=4:8:2", "--seed", "2", "--quiet", "--no-report"]
        whole = self.study("whole", what=what)
        self.assertEqual([point["value"] for point in json.loads(whole)["estimate"]["curve"]], [4, 6, 8])
        for i in range(4):
            self.run_line(ALIDADE, "study", *what, "--shard", f"{i}/4", "--out", f"p{i}")
        self.run_line(ALIDADE, "study", "merge", "p0", "p1", "p2", "p3", "--out", "merged", "--quiet")
        self.assertEqual((self.folder / "merged/study.json").read_bytes(), whole)

    def test_what_cannot_be_merged_is_refused(self):
        for i in range(8):
            self.run_line(ALIDADE, "study", *WHAT, *SMALL, "--shard", f"{i}/8", "--out", f"p{i}")
        merge = [ALIDADE, "study", "merge", "--out", "merged"]
        rest = [f"p{i}" for i in range(8) if i != 3]
        self.assertIn("3/8", self.run_line(*merge, *rest, code=3))
        other = ["observe", "--trials", "3000", "--seed", "10", "--quiet", "--no-report"]
        self.run_line(ALIDADE, "study", *other, "--shard", "3/8", "--out", "seeded")
        self.assertIn("seed 10, not 9", self.run_line(*merge, *rest, "seeded", code=3))
        self.assertIn("twice", self.run_line(*merge, *rest, "p3", "p2", code=3))
        self.run_line(ALIDADE, "study", *WHAT, "--shard", "1/4", "--out", "quarter")
        self.assertIn("1/4", self.run_line(*merge, *rest, "quarter", code=3))
        (self.folder / "empty").mkdir()
        self.assertIn("blocks", self.run_line(*merge, "empty", code=3))
        block = sorted((self.folder / "p3/blocks").iterdir())[1]
        block.write_text(block.read_text()[:-200])
        self.assertIn(block.name, self.run_line(*merge, *rest, "p3", code=3))
        self.assertFalse((self.folder / "merged/study.json").exists())
        block.unlink()
        self.assertIn("3/8 is not whole", self.run_line(*merge, *rest, "p3", code=3))

    def test_a_killed_run_goes_on(self):
        whole = self.study("whole")
        line = [str(ALIDADE), "study", *WHAT, "--block", "10", "--threads", "1", "--out", "killed"]
        blocks = self.folder / "killed/blocks"
        for kill in (signal.SIGKILL, signal.SIGKILL, signal.SIGINT):
            before = len(list(blocks.glob("block-*"))) if blocks.exists() else 0
            running = subprocess.Popen([*line, "--resume"], cwd=self.folder, stderr=subprocess.PIPE, text=True)
            begin = time.monotonic()
            while time.monotonic() - begin < 30 and running.poll() is None:
                if blocks.exists() and len(list(blocks.glob("block-*"))) > before + 5:
                    break
                time.sleep(0.001)
            running.send_signal(kill)
            said = running.communicate()[1]
            if kill == signal.SIGINT and running.returncode == 130:
                self.assertIn("--resume", said)
        self.assertGreater(len(list(blocks.glob("block-*"))), 10)
        self.run_line(*line, "--resume")
        self.assertEqual((self.folder / "killed/study.json").read_bytes(), whole)
        self.assertIn("seed", self.run_line(*line[:2], "observe", "--trials", 3000, "--seed", 1, "--resume", "--out", "killed", code=3))

    def test_one_trial_leaves_its_report_and_its_inputs(self):
        document = json.loads(self.study("one"))
        worst = document["estimate"]["worst"][0]["trial"]
        self.run_line(ALIDADE, "study", *WHAT[:5], "--trial", worst, "--out", "trial", "--quiet")
        result = json.loads((self.folder / "trial/result.json").read_text())
        self.assertEqual(result["command"], "observe")
        self.assertTrue((self.folder / "trial/report.html").exists())
        self.assertIn("fx", result["estimate"]["camera"])
        self.run_line(ALIDADE, "observe", "trial/log.csv", "--method", "batch", "--size", "780x582", "--estimate", "none", "--out", "again", "--quiet")
        again = json.loads((self.folder / "again/result.json").read_text())
        self.assertAlmostEqual(again["estimate"]["camera"]["fx"], result["estimate"]["camera"]["fx"], delta=1e-3)
        self.run_line(ALIDADE, "study", *WHAT[:5], "--trial", 3000, "--out", "none", code=2)

    def test_wrong_usage_is_said(self):
        for words in (["--shard", "8/8"], ["--shard", "x"], ["--trials", "0"], ["--vary", "rows"], ["--vary", "row=1:2:1"], ["--points", "1"],
                      ["--trial", "3", "--shard", "0/2"]):
            self.run_line(ALIDADE, "study", "observe", *words, "--out", "none", code=2)


class Ranks(Folder):
    def test_ranks_make_no_difference(self):
        whole = self.study("whole")
        for ranks in (1, 2, 7):
            out = f"ranks-{ranks}"
            self.run_line(*MPIRUN, "-n", ranks, STUDY, *WHAT, *SMALL, "--out", out)
            self.assertEqual((self.folder / out / "study.json").read_bytes(), whole, ranks)
        self.run_line(*MPIRUN, "-n", 3, STUDY, *WHAT, "--shard", "1/2", "--out", "half-1")
        self.run_line(ALIDADE, "study", *WHAT, "--shard", "0/2", "--out", "half-0")
        self.run_line(ALIDADE, "study", "merge", "half-0", "half-1", "--out", "merged", "--quiet")
        self.assertEqual((self.folder / "merged/study.json").read_bytes(), whole)
        self.run_line(*MPIRUN, "-n", 2, STUDY, "observe", "--shard", "9/2", "--out", "none", code=2)

    def test_a_killed_rank_costs_a_block(self):
        what = ["observe", "--trials", "200000", "--seed", "9", "--block", "1000", "--quiet", "--no-report"]
        whole = self.study("whole", what=what)
        running = subprocess.Popen([*MPIRUN, "-n", "3", str(STUDY), *what, "--out", "killed"], cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        blocks = self.folder / "killed/blocks"
        while running.poll() is None and not (blocks.exists() and len(list(blocks.glob("block-*"))) > 20):
            time.sleep(0.01)
        # A rank that is not 0: a child of mpirun's that came later.
        listed = subprocess.run(["ps", "-eo", "pid,ppid,comm", "--no-headers"], capture_output=True, text=True).stdout
        ranks = sorted(int(row.split()[0]) for row in listed.splitlines() if row.split()[1] == str(running.pid) and row.split()[2].startswith("alidade-study"))
        if running.poll() is None:
            self.assertEqual(len(ranks), 3)
            subprocess.run(["kill", "-9", str(ranks[-1])])
            self.assertNotEqual(running.wait(), 0)
        self.run_line(*MPIRUN, "-n", 2, STUDY, *what, "--resume", "--out", "killed")
        self.assertEqual((self.folder / "killed/study.json").read_bytes(), whole)


if __name__ == "__main__":
    if "Ranks" in sys.argv and (why := why_no_ranks()):
        print(f"skipped: {why}")
        sys.exit(77)
    unittest.main(verbosity=1)
