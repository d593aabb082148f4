#!/usr/bin/env python3
"""Breaks runs of `alidade head` at random instants: tools/head_kills.py ALIDADE [--runs 200] [--seed N] [--together N]
A head and its camera are served by `alidade simulate head`, which writes where it truly is; a link between can be cut or
go silent. Broken are: this program (kill -9, Ctrl-C), the head's server, the stream's server, the link. What must hold:
the head never leaves its limits; where its server lives it stands within a second and a half of the end; exit codes are
those that are named, with one line; what was measured so far is whole (its log is read by `alidade observe`), or is not there;
the password appears nowhere. Prints a table; exit 0 where all of it held."""
import argparse
import collections
import concurrent.futures
import os
import pathlib
import random
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

PAN, TILT = (-25.0, 25.0), (-10.0, 20.0)
SECRET = "s3cret-of-the-head"
BREAKS = ["kill", "interrupt", "head killed", "stream killed", "link cut", "link silent"]
CODES = {"kill": {-9, 0}, "interrupt": {130, 0, 4}, "head killed": {3, 4}, "stream killed": {0, 3, 4, 6}, "link cut": {3, 4},
         "link silent": {3, 4}}
MARGIN_DEG = 0.6  # the plant brakes within it


class Link:
    """Passes bytes between a port of its own and another one, until it is cut or falls silent."""

    def __init__(self, port):
        self.to, self.state, self.open = port, "open", []
        self.server = socket.create_server(("127.0.0.1", 0))
        self.port = self.server.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        while True:
            try:
                here, _ = self.server.accept()
            except OSError:
                return
            if self.state == "cut":
                here.close()
                continue
            try:
                there = socket.create_connection(("127.0.0.1", self.to))
            except OSError:
                here.close()
                continue
            self.open += [here, there]
            threading.Thread(target=self._pair, args=(here, there), daemon=True).start()

    def _pair(self, here, there):
        back = threading.Thread(target=self._pass, args=(there, here), daemon=True)
        back.start()
        self._pass(here, there)
        back.join()
        for each in (here, there):
            self.open.remove(each)
            each.close()

    def _pass(self, a, b):
        try:
            while data := a.recv(65536):
                if self.state == "silent":
                    continue
                b.sendall(data)
        except OSError:
            pass
        for each in (a, b):
            try:
                each.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def set(self, state):
        self.state = state
        if state != "cut":
            return
        for each in list(self.open):
            try:
                each.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def close(self):
        self.server.close()
        self.set("cut")


def serve(alidade, folder, name, *words):
    """A server, its ports by what it says."""
    log = folder / f"{name}.log"
    with open(log, "w") as out:
        process = subprocess.Popen([alidade, "simulate", "head", *words, "--seconds", "300"], stderr=out, stdout=out, cwd=folder)
    for _ in range(200):
        ports = [int(line.rsplit(":", 1)[1].split("/")[0]) for line in log.read_text().splitlines() if "://" in line]
        if len(ports) >= sum(word in ("--rotctl", "--stream", "--onvif") for word in words):
            return process, ports
        time.sleep(0.05)
    process.kill()
    raise RuntimeError(f"{name} does not serve: {log.read_text()}")


def truth_of(file):
    rows = [line.split(",") for line in file.read_text().splitlines()[1:]]
    return [tuple(float(x) for x in row[2:5]) for row in rows if len(row) == 5 and row[4]]


def last_truth(file):
    """Where the head is by what its server wrote last; on a busy machine that may take a while."""
    for _ in range(100):
        rows = truth_of(file) if file.exists() else []
        if rows: return rows[-1]
        time.sleep(0.1)
    raise RuntimeError("the server writes no truth")


def one_run(alidade, seed, what):
    rng = random.Random(seed)
    mode = rng.choice(["calibrate", "calibrate", "follow", "identify"])
    protocol = rng.choice(["rotctl", "rotctl", "onvif"])
    faults = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        words = ["--head", f"rate={rng.choice([6, 12, 30])}&accel=200", "--camera", "size=160x120&fps=15&target=4:0:3:20:2"]
        env = dict(os.environ, ALIDADE_PASSWORD=SECRET)
        os.environ["ALIDADE_PASSWORD"] = SECRET
        kinds = ["--rotctl", "0"] if protocol == "rotctl" else ["--onvif", "0", "--user", "me"]
        head, (head_port, own_stream) = serve(alidade, folder, "head", *kinds, "--stream", "0", "--truth", "truth.csv", *words)
        eye, (stream_port,) = serve(alidade, folder, "eye", "--stream", "0", *words) if what == "stream killed" else (None, (own_stream,))
        link = Link(head_port)
        url = f"rotctl://127.0.0.1:{link.port}" if protocol == "rotctl" else f"onvif://me@127.0.0.1:{link.port}/?az=-170:170&el=-30:60"
        rig = folder / "rig.yaml"
        rig.write_text("heads:\n- {id: 1, camera: camera.yaml}\n")
        (folder / "camera.yaml").write_text("model: brown\nwidth: 160\nheight: 120\nfx: 175\nfy: 174\ncx: 81.6\ncy: 58.9\nskew: 0\nk1: -0.08\nk2: 0\np1: 0\np2: 0\nk3: 0\n")
        doing = {"calibrate": ["--calibrate"], "identify": ["--identify"], "follow": ["--rig", "rig.yaml", "--follow", "bright", "--most", "60"]}[mode]
        stream = [] if mode == "identify" else ["--stream", f"http://127.0.0.1:{stream_port}/stream.mjpg"]
        client = subprocess.Popen([alidade, "head", url, *stream, *doing, "--move", f"--pan-range={PAN[0]},{PAN[1]}", f"--tilt-range={TILT[0]},{TILT[1]}",
                                   "--out", "out"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder, env=env)
        time.sleep(rng.uniform(0.3, 14.0))
        if what == "kill": client.kill()
        if what == "interrupt": client.send_signal(signal.SIGINT)
        if what == "head killed": head.kill()
        if what == "stream killed": eye.kill()
        if what == "link cut": link.set("cut")
        if what == "link silent": link.set("silent")
        try:
            out, err = client.communicate(timeout=250)  # identifying a slow head takes two minutes
        except subprocess.TimeoutExpired:
            client.kill()
            out, err = client.communicate()
            faults.append("does not end")
        code = client.returncode
        allowed = CODES[what] | ({0, 4, 6} if what == "stream killed" and mode == "identify" else set())
        if code not in allowed: faults.append(f"exit code {code}: {err.strip()[:200]}")
        lines = [line for line in err.replace("\r", "\n").splitlines() if line.startswith("alidade: ")]
        if code not in (0, -9) and len(lines) != 1: faults.append(f"{len(lines)} lines: {err[:200]}")
        time.sleep(1.5)
        if head.poll() is None:
            before = last_truth(folder / "truth.csv")
            time.sleep(0.4)
            after = last_truth(folder / "truth.csv")
            if max(abs(after[i] - before[i]) for i in (1, 2)) > 1e-6: faults.append("still moves")
        for _, pan, tilt in truth_of(folder / "truth.csv"):
            deg = [57.29577951308232 * x for x in (pan, tilt)]
            if not (PAN[0] - MARGIN_DEG < deg[0] < PAN[1] + MARGIN_DEG and TILT[0] - MARGIN_DEG < deg[1] < TILT[1] + MARGIN_DEG):
                faults.append(f"beyond its limits: {deg}")
                break
        for process in (head, eye):
            if process: process.kill(), process.wait()
        link.close()
        faults += left_behind(alidade, folder, mode)
        if any(SECRET in text for text in [out, err, *(f.read_text(errors="replace") for f in folder.rglob("*") if f.is_file())]):
            faults.append("the password is written")
    return what, f"{mode} {protocol}", faults


def left_behind(alidade, folder, mode):
    """What a broken run left is whole: logs with all their cells, and read by `observe`."""
    faults = []
    for log in (folder / "out").rglob("log.csv") if (folder / "out").is_dir() else []:
        if any(part.startswith(".alidade-") for part in log.parts): continue
        lines = log.read_text().splitlines()
        if any(line.count(",") != lines[0].count(",") for line in lines): faults.append(f"{log.name} is cut off")
        if len(lines) < 20: continue
        observed = subprocess.run([alidade, "observe", str(log), "--size", "160x120", "--estimate", "k1,mount,delay", "--no-zoom", "--method", "batch", "--out",
                               str(folder / "again")], capture_output=True, text=True)
        if observed.returncode not in (0, 4, 5, 6): faults.append(f"observe: {observed.stderr[:200]}")
    return faults


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("alidade", type=pathlib.Path)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--together", type=int, default=6)
    options = parser.parse_args()
    counts, bad = collections.Counter(), collections.Counter()
    with concurrent.futures.ThreadPoolExecutor(options.together) as pool:
        jobs = [pool.submit(one_run, str(options.alidade.resolve()), options.seed * 1000 + i, BREAKS[i % len(BREAKS)]) for i in range(options.runs)]
        for job in concurrent.futures.as_completed(jobs):
            try:
                what, how, faults = job.result()
            except RuntimeError as error:  # a server that does not come up is no run
                print(f"not run: {error}", flush=True)
                continue
            counts[what] += 1
            bad[what] += bool(faults)
            for fault in faults: print(f"{what}, {how}: {fault}", flush=True)
    print(f"# Runs with a head, interrupted at random instants\n\n`tools/head_kills.py build/release/alidade --runs {options.runs} --seed {options.seed}`: the comment at the top of the tool lists what must hold.\n")
    print("| interruption | runs | failed |\n|---|---|---|")
    for what in BREAKS: print(f"| {what} | {counts[what]} | {bad[what]} |")
    return 1 if sum(bad.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
