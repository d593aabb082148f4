#!/usr/bin/env python3
"""`alidade head --calibrate` on a head that others made, over seeds: tools/head_seeds.py ALIDADE WORLD [--seeds 20] [--first 1] [--together 2]
The head is Hamlib's `rotctld -m 1`. WORLD is a program that shows what a camera on it sees:
    WORLD PORT_OF_ROTCTLD PORT --truth DIR --seed N --f FX,FY --c CX,CY --k1 K --mount X,Y,Z --delay SECONDS
serves motion JPEG with capture times on http://127.0.0.1:PORT/stream.mjpg, mounted by a rotation vector in degrees, its frames so
much late, and prints a line with the address when it does. Each seed has a lens, a mounting and a delay of its own.
Judged: all nine values within 3 sigma in 97.5 % of them, f within 0.02 %, the delay within 10 ms, 90 s of head time, and the
off-line run of log.csv the same to the last digit. Prints a page; exit 0 where all of it held."""
import argparse
import collections
import concurrent.futures
import json
import math
import pathlib
import random
import re
import socket
import subprocess
import sys
import tempfile
import time

NAMES = ["fx", "fy", "cx", "cy", "k1", "mount_x_rad", "mount_y_rad", "mount_z_rad", "delay_s"]
FOCAL, DELAY_S, HEAD_S = 2e-4, 0.010, 90.0


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


def answers(port, process, seconds=120.0):
    for _ in range(int(10 * seconds)):
        if process.poll() is not None: return False
        try:
            socket.create_connection(("127.0.0.1", port), 0.5).close()
            return True
        except OSError:
            time.sleep(0.1)
    return False


def truth_of(seed):
    rng = random.Random(seed)
    fx = rng.uniform(500.0, 900.0)
    mount = [rng.uniform(-4.0, 4.0) for _ in range(3)]
    return {"fx": fx, "fy": fx * rng.uniform(0.99, 1.01), "cx": 319.5 + rng.uniform(-12, 12), "cy": 239.5 + rng.uniform(-12, 12),
            "k1": rng.uniform(-0.15, 0.05), **{f"mount_{axis}_rad": math.radians(x) for axis, x in zip("xyz", mount)},
            "delay_s": -rng.uniform(0.0, 0.08)}  # a frame that is stamped late shows earlier angles


def values_of(document):
    estimate, sigma = document["estimate"], document["stddev"]
    pick = lambda table, name: table["camera"].get(name, table.get(name)) if name in table["camera"] else table.get(name)
    return {name: pick(estimate, name) for name in NAMES}, {name: pick(sigma, name) for name in NAMES}


def one_seed(alidade, world, seed):
    true = truth_of(seed)
    with tempfile.TemporaryDirectory() as name:
        folder, head_port, port = pathlib.Path(name), free_port(), free_port()
        head = subprocess.Popen(["rotctld", "-m", "1", "-T", "127.0.0.1", "-t", str(head_port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        sees = None
        try:
            if not answers(head_port, head): raise RuntimeError("rotctld does not answer")
            mount = ",".join(repr(math.degrees(true[f"mount_{axis}_rad"])) for axis in "xyz")
            sees = subprocess.Popen([str(world), str(head_port), str(port), "--truth", str(folder / "truth"), "--seed", str(seed), f"--f={true['fx']!r},{true['fy']!r}",
                                     f"--c={true['cx']!r},{true['cy']!r}", f"--k1={true['k1']!r}", f"--mount={mount}", f"--delay={-true['delay_s']!r}"],
                                    stdout=subprocess.DEVNULL)
            if not answers(port, sees): raise RuntimeError("the world does not answer")
            run = subprocess.run([alidade, "head", f"rotctl://127.0.0.1:{head_port}", "--stream", f"http://127.0.0.1:{port}/stream.mjpg", "--calibrate",
                                  "--move", "--pan-range=-60,60", "--tilt-range=0,40", "--out", "out", "--quiet"], cwd=folder, capture_output=True, text=True)
            if run.returncode not in (0, 6): raise RuntimeError(f"exit code {run.returncode}: {run.stderr.strip()[-300:]}")
            document = json.loads((folder / "out" / "result.json").read_text())
            value, sigma = values_of(document)
            again = subprocess.run([alidade, *document["estimate"]["offline"], "--out", "again", "--quiet"], cwd=folder / "out", capture_output=True, text=True)
            offline = values_of(json.loads((folder / "out" / "again" / "result.json").read_text()))[0] if again.returncode == run.returncode else None
        finally:
            for process in (sees, head):
                if process: process.terminate(), process.wait()
    return {"seed": seed, "code": run.returncode, "state": document["verdict"]["state"], "off": {k: (value[k] - true[k]) / sigma[k] for k in NAMES},
            "focal": max(abs(value[k] / true[k] - 1) for k in ("fx", "fy")), "sigma_focal": max(sigma[k] / value[k] for k in ("fx", "fy")),
            "cares": [check["name"] + ": " + re.sub(r"[-+]?\d[\d.e+-]*", "…", check["text"]) for check in document["verdict"]["checks"] if check["state"] not in ("good", "ok")],
            "delay": abs(value["delay_s"] - true["delay_s"]), "time": document["estimate"]["head_time_s"], "same": offline == value}


def page(rows, failed, options):
    """A page with what was asked and seen, and whether all of it held."""
    offs = [abs(x) for row in rows for x in row["off"].values()]
    within = sum(x <= 3.0 for x in offs)
    lines = [("fx, fy, cx, cy, k1, mounting, delay within 3σ", f"97.5 % of {len(offs)}",
              f"{within}, RMS {math.sqrt(sum(x * x for x in offs) / len(offs)):.2f} σ", within >= 0.975 * len(offs)),
             ("fx and fy off by at most", f"{100 * FOCAL:g} %", f"{100 * max(row['focal'] for row in rows):.4f} % (σ {100 * max(row['sigma_focal'] for row in rows):.4f} %)",
              all(row["focal"] < FOCAL for row in rows)),
             ("delay off by at most", f"{1e3 * DELAY_S:g} ms", f"{1e3 * max(row['delay'] for row in rows):.2f} ms", all(row["delay"] < DELAY_S for row in rows)),
             ("head time", f"{HEAD_S:g} s", f"{min(row['time'] for row in rows):.0f} to {max(row['time'] for row in rows):.0f} s", all(row["time"] <= HEAD_S for row in rows)),
             ("offline the same to the last digit", "all", f"{sum(row['same'] for row in rows)} of {len(rows)}", all(row["same"] for row in rows)),
             ("without an answer", "0", f"{failed}", failed == 0)]
    print(f"""# A camera that calibrates itself, on a third-party head

`tools/head_seeds.py build/release/alidade WORLD --seeds {options.seeds} --first {options.first} --together {options.together}`: Hamlib's `rotctld -m 1`, and a rendered
world that reads the angle from it (`WORLD`: a program that serves it; the comment at the top of the tool says how it is called); each seed has a lens
(f 500 to 900 px), a mounting (4° per axis) and a delay (up to 80 ms) of its own.

| {len(rows) + failed} seeds | required | measured |
|---|---|---|""")
    for what, asked, seen, holds in lines: print(f"| {what} | {asked} | {seen}{'' if holds else ' ✗'} |")
    print(f"\nVerdict ●: {sum(row['state'] == 'good' for row in rows)} of {len(rows)}. The reasons of the others, and how often they were given:\n")
    said = collections.Counter(care for row in rows for care in row["cares"])
    for care, times in said.most_common(): print(f"- {times}: {care}")
    print("\n| seed | f off [%] | delay off [ms] | head time [s] | largest error [σ] |\n|---|---|---|---|---|")
    for row in sorted(rows, key=lambda row: row["seed"]):
        print(f"| {row['seed']} | {100 * row['focal']:.4f} | {1e3 * row['delay']:.2f} | {row['time']:.0f} | {max(map(abs, row['off'].values())):.1f} |")
    return all(holds for *_, holds in lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("alidade", type=pathlib.Path)
    parser.add_argument("world", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--together", type=int, default=2)
    options = parser.parse_args()
    rows, failed = [], 0
    with concurrent.futures.ThreadPoolExecutor(options.together) as pool:
        jobs = [pool.submit(one_seed, str(options.alidade.resolve()), options.world.resolve(), options.first + i) for i in range(options.seeds)]
        for job in concurrent.futures.as_completed(jobs):
            try: row = job.result()
            except (RuntimeError, OSError, KeyError, ValueError) as fault:
                failed += 1
                print(f"seed {options.first + jobs.index(job)}: {fault}", file=sys.stderr, flush=True)
                continue
            rows.append(row)
            print(f"seed {row['seed']}: {row['state']}, f off {100 * row['focal']:.4f} %, delay {1e3 * row['delay']:.2f} ms, {row['time']:.0f} s, "
                  + " ".join(f"{k} {x:+.1f}σ" for k, x in row["off"].items()) + ("" if row["same"] else ", off line another"), file=sys.stderr, flush=True)
    return 0 if rows and page(rows, failed, options) else 1


if __name__ == "__main__":
    sys.exit(main())
