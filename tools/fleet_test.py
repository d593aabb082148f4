#!/usr/bin/env python3
"""alidade fleet on a NATS broker: workers and the broker are killed, and every state is the same bytes as without.

    tools/fleet_test.py build/release/alidade

The broker listens on the loopback alone, on a free port, and keeps its files in a folder that goes. Without nats-server or
alidade-fleet: skipped (77). What the broker holds is read over its own protocol, by nobody's client.
"""
import json
import pathlib
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.request

ALIDADE = pathlib.Path(sys.argv.pop(1)).resolve()
CAMERAS, ROWS = 40, 150


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Client:
    """Requests over a connection of its own."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), 5)
        self.file = self.socket.makefile("rb")
        self.file.readline()
        self.socket.sendall(b'CONNECT {"verbose":false,"headers":true}\r\nSUB answer 1\r\n')

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.file.close()
        self.socket.close()

    def ask(self, subject, text):
        self.socket.sendall(f"PUB {subject} answer {len(text.encode())}\r\n".encode() + text.encode() + b"\r\n")
        while True:
            line = self.file.readline().decode().split()
            if not line:
                raise OSError("the broker has gone")
            if line[0] == "PING":
                self.socket.sendall(b"PONG\r\n")
            if line[0] == "MSG":
                payload = self.file.read(int(line[-1]) + 2)[:-2]
                return json.loads(payload)

    def state(self, camera):
        """The last state's bytes; None: there is none."""
        import base64
        answer = self.ask("$JS.API.STREAM.MSG.GET.ALIDADE_STATE", json.dumps({"last_by_subj": f"cam.{camera}.state"}))
        return base64.b64decode(answer["message"]["data"]) if "message" in answer else None


class Fleet(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.port, self.started = free_port(), []
        self.url = f"nats://127.0.0.1:{self.port}"
        self.addCleanup(self.clear)
        self.start_broker()

    def clear(self):
        for process in self.started:
            if process.poll() is None:
                process.kill()
                process.wait()
        shutil.rmtree(self.folder)

    def start(self, *words, **more):
        process = subprocess.Popen([str(word) for word in words], cwd=self.folder, **more)
        self.started.append(process)
        return process

    def start_broker(self):
        self.broker = self.start("nats-server", "-a", "127.0.0.1", "-p", self.port, "-js", "-sd", self.folder / "store", "-l", self.folder / "log")
        for _ in range(200):
            try:
                with Client(self.port):
                    return
            except OSError:
                time.sleep(0.05)
        self.fail("nats-server does not start")

    def start_worker(self):
        return self.start(ALIDADE, "fleet", "worker", "--nats", self.url, "--size", "640x480", "--quiet", stderr=subprocess.DEVNULL)

    def publish(self, **more):
        return self.start(ALIDADE, "simulate", "fleet", "--cameras", CAMERAS, "--rows", ROWS, "--rate", 10, "--event-after", 5, "--events", 0.8,
                          "--publish", "--nats", self.url, "--out", "published", "--quiet", **more)

    def expected(self):
        """The states of all rows through one worker without a broker."""
        simulate = [ALIDADE, "simulate", "fleet", "--cameras", CAMERAS, "--rows", ROWS, "--rate", "10", "--event-after", "5", "--events", "0.8", "--out", "made", "--quiet"]
        subprocess.run([str(word) for word in simulate], cwd=self.folder, check=True)
        subprocess.run([ALIDADE, "fleet", "worker", "--from", "made/rows.txt", "--size", "640x480", "--out", "states", "--quiet"], cwd=self.folder, check=True)
        lines = (self.folder / "states/states.jsonl").read_bytes().splitlines()
        self.assertGreater(len((self.folder / "states/alarms.jsonl").read_text()), 0)
        return {json.loads(line)["camera"]: line for line in lines}

    def wait_for(self, expected, seconds=60):
        until, found = time.monotonic() + seconds, {}
        while time.monotonic() < until:
            try:
                with Client(self.port) as client:
                    found = {camera: client.state(camera) for camera in expected}
            except OSError:
                pass
            if all(state and json.loads(state)["n"] == ROWS for state in found.values()) and len(found) == len(expected):
                break
            time.sleep(0.3)
        self.assertEqual({camera: (state or b"").decode() for camera, state in found.items()}, {camera: line.decode() for camera, line in expected.items()})

    def test_a_quiet_run_and_its_end(self):
        expected, worker = self.expected(), self.start_worker()
        self.assertEqual(self.publish().wait(120), 0)
        self.wait_for(expected)
        watch = self.start(ALIDADE, "fleet", "watch", "--nats", self.url, "--port", "0", stderr=subprocess.PIPE, text=True)
        address = watch.stderr.readline().split()[-1]
        for _ in range(100):
            fleet = json.loads(urllib.request.urlopen(address + "fleet.json").read())
            if fleet["cameras"] == CAMERAS and fleet["alarms"] > 0:
                break
            time.sleep(0.1)
        self.assertEqual(fleet["cameras"], CAMERAS)
        self.assertGreater(fleet["alarms"], 0)
        ranks = [{"bad": 4, "not_converged": 3, "care": 2, "refused": 1}.get(state, 0) for _, state, _ in fleet["map"]]
        self.assertEqual(ranks, sorted(ranks, reverse=True), "the worst first")
        self.assertEqual({camera for camera, _, _ in fleet["map"]}, set(expected))
        worst = json.loads(urllib.request.urlopen(address + f"camera/{fleet['map'][0][0]}.json").read())
        self.assertEqual(worst["camera"], fleet["worst"][0]["camera"])
        one = json.loads(urllib.request.urlopen(address + "camera/c00001.json").read())
        self.assertEqual(one["camera"], "c00001")
        state = json.loads(expected["c00001"])
        self.assertAlmostEqual(one["history"][-1]["fx"], state["estimate"]["fx"], delta=1e-3)
        self.assertAlmostEqual(one["history"][-1]["sigma_fx"], state["stddev"]["fx"], delta=1e-5)
        for process in (worker, watch):
            process.send_signal(signal.SIGTERM)
            self.assertEqual(process.wait(20), 0)
        watch.stderr.close()

    def test_workers_share_the_cameras(self):
        expected = self.expected()
        workers = [self.start(ALIDADE, "fleet", "worker", "--nats", self.url, "--size", "640x480", stderr=subprocess.PIPE, text=True) for _ in range(2)]
        time.sleep(2)
        self.assertEqual(self.publish().wait(120), 0)
        self.wait_for(expected)
        rows = []
        for worker in workers:
            worker.send_signal(signal.SIGTERM)
            rows.append(int(re.search(r"(\d+)(?: of \d+)? rows of", worker.communicate(timeout=20)[1])[1]))
        self.assertGreaterEqual(min(rows), CAMERAS * ROWS // 5, rows)

    def rows_of(self, camera):
        """The rows of a simulated camera."""
        self.expected()
        lines = (self.folder / "made/rows.txt").read_text().splitlines()
        return [json.loads(line.split(" ", 1)[1]) for line in lines if line.startswith(camera + " ")]

    def test_lost_rows_and_restarts_are_said(self):
        rows = self.rows_of("c00004")
        worker = self.start(ALIDADE, "fleet", "worker", "--nats", self.url, "--size", "640x480", stderr=subprocess.PIPE, text=True)
        time.sleep(1.5)
        slow = [{**row, "t": 10 * row["t"]} for row in rows]  # 1 Hz: a gap is given up after half a minute of them
        sent = {"gap": [row for row in slow if row["n"] != 50],
                "late": slow[9:],
                "waits": [row for row in rows[:60] if row["n"] != 50],
                "none": rows[9:20],
                "reboot": rows[:100] + [{**row, "n": i + 1} for i, row in enumerate(rows[100:])]}
        with Client(self.port) as client:
            for camera, some in sent.items():
                for row in some:
                    client.ask(f"cam.{camera}.obs", json.dumps(row))
            client.ask("cam.gap.obs", json.dumps(slow[9]))
            client.ask("cam.gap.obs", "nonsense")
            time.sleep(3)
            states = {camera: json.loads(client.state(camera)) for camera in sent}
        worker.send_signal(signal.SIGTERM)
        said = worker.communicate(timeout=20)[1]
        self.assertEqual({camera: state["n"] for camera, state in states.items()}, {"gap": ROWS, "late": ROWS, "waits": 49, "none": 0, "reboot": ROWS - 100})
        self.assertEqual([states[camera].get(count, 0) for camera, count in (("gap", "missing"), ("late", "missing"), ("waits", "missing"), ("reboot", "restarts"))], [1, 9, 0, 1])
        self.assertEqual(states["reboot"]["t"], rows[-1]["t"])
        for camera, words in (("gap", "1 row never came"), ("late", "9 rows never came"), ("none", "wait for the first"), ("reboot", "its observer restarted")):
            self.assertIn(words, states[camera]["verdict"]["sentence"])
        for words in ("cam.gap.obs: one row before row 51 never came", "cam.gap.obs: row 10 came again, or too late", "cam.waits.obs: row 50 has not come", "cam.none.obs: row 1 has not come",
                      "cam.reboot.obs: the observer restarted: row 1"):
            self.assertIn(words, said)
        taken = ROWS - 1 + ROWS - 9 + 49 + ROWS
        self.assertIn(f"{taken} of {taken + 10 + 11 + 1 + 1} rows of 5 cameras taken in: 21 wait for one before them (", said)
        self.assertTrue(said.rstrip().endswith("1 came again, or too late; 1 are no rows; 10 never came; 1 restart of an observer"), said)

    def test_a_server_without_jetstream(self):
        self.broker.kill()
        self.broker.wait()
        self.start("nats-server", "-a", "127.0.0.1", "-p", self.port, "-l", self.folder / "log")
        for words in (["fleet", "worker", "--size", "640x480"], ["fleet", "watch", "--port", "0"], ["simulate", "fleet", "--publish", "--cameras", "2", "--rows", "3"]):
            begin = time.monotonic()
            done = subprocess.run([str(ALIDADE), *words, "--nats", self.url], capture_output=True, text=True, timeout=60, cwd=self.folder)
            self.assertEqual(done.returncode, 3, done.stderr)
            self.assertIn("has no JetStream", done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
            self.assertLess(time.monotonic() - begin, 10)

    def test_a_publisher_that_is_stopped(self):
        for rate, known in ((0.01, 0), (1, 5)):  # the broker knows the first rows by their numbers
            publisher = self.start(ALIDADE, "simulate", "fleet", "--cameras", "5", "--rows", "600", "--rate", rate, "--publish", "--nats", self.url, "--out", "stopped", stderr=subprocess.PIPE, text=True)
            time.sleep(2)
            publisher.send_signal(signal.SIGINT)
            begin = time.monotonic()
            said = publisher.communicate(timeout=20)[1]
            self.assertLess(time.monotonic() - begin, 1.0)
            self.assertEqual(publisher.returncode, 130)
            rows = int(re.search(r"interrupted; (\d+) rows of 5 cameras are published; no files are written", said)[1])
            self.assertEqual(rows - known, self.stored(), said)
            self.assertGreaterEqual(rows, 5 + known)

    def stored(self):
        """Observations since the last time that this was asked."""
        with Client(self.port) as client:
            count = client.ask("$JS.API.STREAM.INFO.ALIDADE_OBS", "")["state"]["messages"]
        before, self.counted = getattr(self, "counted", 0), count
        return count - before

    def test_workers_and_the_broker_die(self):
        expected, chance = self.expected(), random.Random(1)
        workers = [self.start_worker() for _ in range(3)]
        publisher = self.publish()
        for kill in range(8):
            time.sleep(1.5)
            if kill in (2, 5):
                self.broker.kill()
                self.broker.wait()
                self.start_broker()
                continue
            k = chance.randrange(3)
            workers[k].kill()
            workers[k].wait()
            workers[k] = self.start_worker()
        self.assertEqual(publisher.wait(120), 0)
        self.wait_for(expected)

    def test_what_is_wrong_is_said(self):
        for words, code in ((["--nats", f"nats://127.0.0.1:{free_port()}", "--size", "640x480"], 3), (["--nats", self.url, "--size", "640"], 2), (["--nats", self.url], 2)):
            done = subprocess.run([ALIDADE, "fleet", "worker", *words], capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, code, done.stderr)
            self.assertEqual(done.stderr.count("alidade: error:"), 1, done.stderr)


if __name__ == "__main__":
    if not shutil.which("nats-server") or not ALIDADE.with_name("alidade-fleet").exists():
        print("skipped: no nats-server, or built without libnats")
        sys.exit(77)
    unittest.main(verbosity=1)
