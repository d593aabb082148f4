#!/usr/bin/env python3
"""A day of rows on standard input: tools/long_runs.py ALIDADE [--rows N] [--keep-rows N] [--frames N] [--commands observe,track,localize]. Measurements are
simulated here, with known truth, and given as fast as they are answered. What must hold: every row is answered; memory is flat once the
rows kept are full; processor time a row is flat; σ at the end is what the errors are. One line of figures for each command."""
import argparse
import math
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import threading

SIZE = (780, 582)
TRUTH = {"fx": 712.0, "fy": 705.0, "cx": 395.0, "cy": 288.0}
SIGMA_PX = 0.3
PARTS = 20  # of a run, each with its memory and its time
LEAST_TIMED_S = 1.0  # a process's time is counted in hundredths: of less than this a fifth more says nothing


def head_rows(count, seed):
    """A camera on a head that sways without end, and eight far points."""
    noise = random.Random(seed)
    points = [(0.35 * math.cos(0.8 * i), 0.25 * math.sin(0.8 * i), 1.0) for i in range(8)]
    yield "t,pan,tilt,roll," + ",".join(f"p{i + 1}x,p{i + 1}y" for i in range(len(points)))
    for row in range(count):
        t = row / 30.0
        pan, tilt = 0.22 * math.sin(0.61 * t) + 0.05 * math.sin(2.3 * t), 0.16 * math.sin(0.47 * t + 1.0)
        cells = [f"{t:.6f}", f"{pan:.9f}", f"{tilt:.9f}", "0"]
        sp, cp, st, ct = math.sin(pan), math.cos(pan), math.sin(tilt), math.cos(tilt)
        for x, y, z in points:  # point in the camera: tilt⁻¹ pan⁻¹
            a, b = cp * x + sp * z, -sp * x + cp * z
            y, b = ct * y + st * b, -st * y + ct * b
            u, v = TRUTH["fx"] * a / b + TRUTH["cx"], TRUTH["fy"] * y / b + TRUTH["cy"]
            # By where it is, not by where it is measured: errors that point inwards would be seen more often.
            seen = 2.0 <= u <= SIZE[0] - 2.0 and 2.0 <= v <= SIZE[1] - 2.0
            cells += [f"{u + noise.gauss(0.0, SIGMA_PX):.4f}", f"{v + noise.gauss(0.0, SIGMA_PX):.4f}"] if seen else ["", ""]
        yield ",".join(cells)


def target_at(t):
    return 0.4 * math.cos(0.1 * math.pi * t), 0.3 * math.sin(0.2 * math.pi * t), 3.0 + 0.5 * math.sin(0.1 * math.pi * t)


class TrackSource:
    """Hours that `simulate track` makes, one after the other: the path has a period of 20 s, and an hour is 180 of them."""

    def __init__(self, alidade, folder, count):
        self.alidade, self.folder, self.count = alidade, folder, count
        path = folder / "path.csv"
        path.write_text("t_s,x_m,y_m,z_m\n" + "".join(
            "{:.3f},{:.9f},{:.9f},{:.9f}\n".format(0.05 * i, *target_at(0.05 * i)) for i in range(72001)))
        self.hour(1)

    def hour(self, number):
        subprocess.run([self.alidade, "simulate", "track", "--scenario", "B", "--path", self.folder / "path.csv", "--duration", "3600",
                        "--seed", str(number), "--out", self.folder / "hour", "--no-report", "--quiet"], check=True)
        return open(self.folder / "hour" / "events.csv")

    def rows(self):
        given, number = 0, 0
        while given < self.count:
            number += 1
            with self.hour(number) as events:
                header = next(events).strip()
                if number == 1:
                    yield header
                for line in events:
                    capture, arrival, rest = line.strip().split(",", 2)
                    if float(capture) >= 3600.0 or given >= self.count:
                        break
                    offset = 3600.0 * (number - 1)
                    yield f"{float(capture) + offset:.6f},{float(arrival) + offset:.6f},{rest}"
                    given += 1


def walk_at(t):
    """Along a wall and back, every 80 s: where the camera is, and how it is turned (about y, then x)."""
    return (3.0 * math.sin(math.pi * t / 40.0), 0.06 * math.sin(0.8 * t), 0.06 * math.sin(0.5 * t)), 0.08 * math.sin(0.7 * t), 0.05 * math.sin(1.1 * t)


class WalkSource:
    """Numbered points that a camera sees; six of them, given to a millimetre (and off by that), are the target."""

    def __init__(self, folder, frames, seed):
        self.noise, self.frames = random.Random(seed), frames
        target = [(-0.15, -0.1, 1.2), (0.15, -0.1, 1.2), (0.15, 0.1, 1.2), (-0.15, 0.1, 1.2), (0.05, 0.0, 1.2), (-0.05, 0.05, 1.2)]
        self.points = target + [(self.noise.uniform(-4.0, 4.0), self.noise.uniform(-0.8, 0.8), self.noise.uniform(1.0, 2.2))
                                for _ in range(160)]
        (folder / "camera.yaml").write_text("model: pinhole\nwidth: 768\nheight: 576\nfx: 610\nfy: 610\ncx: 384\ncy: 288\nskew: 0\n")
        errors = random.Random(seed + 1000)
        given = [[x + errors.gauss(0.0, 0.001) for x in point] for point in target]
        (folder / "target.yaml").write_text("points:\n" + "".join(
            f"  - {{id: {i}, x_m: {x}, y_m: {y}, z_m: {z}, sigma_m: 0.001}}\n" for i, (x, y, z) in enumerate(given)))

    def rows(self):
        yield "frame,t_s,point_id,u_px,v_px"
        for frame in range(self.frames + 1):  # a frame is answered when the next one begins
            t = frame / 30.0
            (cx, cy, cz), yaw, pitch = walk_at(t)
            sy, ky, sp, kp = math.sin(yaw), math.cos(yaw), math.sin(pitch), math.cos(pitch)
            for i, (x, y, z) in enumerate(self.points):
                if abs(x - cx) > 2.2:
                    continue
                a, b, c = x - cx, y - cy, z - cz
                a, c = ky * a - sy * c, sy * a + ky * c  # the camera's turn, taken back
                b, c = kp * b + sp * c, -sp * b + kp * c
                u, v = 610.0 * a / c + 384.0, 610.0 * b / c + 288.0
                if 0.0 <= u <= 767.0 and 0.0 <= v <= 575.0:
                    yield f"{frame},{t:.9f},{i},{u + self.noise.gauss(0.0, 0.5):.3f},{v + self.noise.gauss(0.0, 0.5):.3f}"


def walk_held(parts, answered, frames, poses, code):
    """Says the figures of a long walk, and what does not hold."""
    faults = []
    if answered != frames:
        faults.append(f"{answered} of {frames} frames answered")
    if code != 0:
        faults.append(f"exit code {code}")
    half = parts[len(parts) // 2:]
    bytes_a_frame = 1024.0 * (half[-1][1] - half[0][1]) / (half[-1][0] - half[0][0])
    is_long = frames > 40000  # five times the frames that are kept
    if is_long and bytes_a_frame > 1500.0:  # a step of the path, and a list that doubles
        faults.append(f"memory grows by {bytes_a_frame:.0f} bytes a frame")
    third = max(1, len(parts) // 3)
    first = parts[third - 1][2] / parts[third - 1][0]
    last = (parts[-1][2] - parts[-1 - third][2]) / (parts[-1][0] - parts[-1 - third][0])
    if is_long and last > 1.2 * first:
        faults.append(f"the last frames take {last / first:.2f} times the first ones' time")
    squares = variances = lost = 0.0
    with open(poses) as file:
        names = next(file).strip().split(",")
        for line in file:
            cells = dict(zip(names, line.strip().split(",")))
            lost += cells["event"] in ("waiting", "predicted")
            squares += sum((float(cells[f"{axis}_m"]) - at) ** 2 for axis, at in zip("xyz", walk_at(float(cells["t_s"]))[0]))
            variances += sum(float(cells[f"cov_{axis}_{axis}"]) for axis in "xyz")
    rms, sigma = math.sqrt(squares / answered), math.sqrt(variances / answered)
    if lost:
        faults.append(f"{lost:.0f} frames lost")
    if not rms < 2.5 * sigma:
        faults.append("sigma is too small")
    print(f"localize -: {answered} frames, {1e3 * first:.2f} ms a frame in the first third, {1e3 * last:.2f} ms in the last, "
          f"{parts[-1][1] / 1024:.0f} MB, {bytes_a_frame:.0f} bytes a frame more in the second half; error {1e3 * rms:.1f} mm, "
          f"sigma {1e3 * sigma:.1f} mm" + "".join(f"; FAILS: {fault}" for fault in faults), flush=True)
    return not faults


def memory_kb(pid):
    for line in open(f"/proc/{pid}/status"):
        if line.startswith("VmRSS:"):
            return int(line.split()[1])
    return 0


def seconds_of(pid):
    fields = open(f"/proc/{pid}/stat").read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def run(words, rows, count, judge):
    """Parts of the run as (rows answered, kB, s), what `judge` made of the answers, and the exit code."""
    process = subprocess.Popen([str(word) for word in words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    parts = []

    def write():
        try:
            for row in rows:
                process.stdin.write(row + "\n")
            process.stdin.flush()
            asked.wait()  # the last part is measured before the end begins
            process.stdin.close()
        except BrokenPipeError:
            pass

    asked = threading.Event()
    writer = threading.Thread(target=write)
    writer.start()
    names, answered = next(process.stdout).strip().split(","), 0
    for line in process.stdout:
        if answered == count:
            break  # what the command prints at its end
        answered += 1
        judge(names, line, answered)
        if answered % (count // PARTS) == 0:
            parts.append((answered, memory_kb(process.pid), seconds_of(process.pid)))
        if answered == count:
            asked.set()
    asked.set()
    for _ in process.stdout:
        pass
    writer.join()
    return parts, answered, process.wait()


class Errors:
    """z of some answers, far enough apart that they err for themselves."""

    def __init__(self, every, pairs):
        self.every, self.pairs, self.z = every, pairs, []

    def __call__(self, names, line, number):
        if number % self.every:
            return
        cells = dict(zip(names, line.strip().split(",")))
        for value, sigma, truth in self.pairs(cells):
            self.z.append((float(cells[value]) - truth) / float(cells[sigma]) if cells.get(value) else math.nan)


def observe_pairs(_):
    return [(name, f"sigma_{name}", truth) for name, truth in TRUTH.items()]


def track_pairs(cells):
    return [(f"{axis}_m", f"sigma_{axis}_m", value) for axis, value in zip("xyz", target_at(float(cells["t_s"])))]


def held(name, parts, answered, count, keep, z, code, is_learned_once):
    """Says the figures, and what does not hold."""
    faults = []
    if answered != count:
        faults.append(f"{answered} of {count} rows answered")
    if code not in (0, 6):
        faults.append(f"exit code {code}")
    full = [part for part in parts if part[0] >= 2.2 * keep] or parts[-2:]
    growth = max(part[1] for part in full) / full[0][1] - 1.0
    if growth > 0.05:
        faults.append(f"memory grows by {100 * growth:.0f} %")
    third = max(1, len(parts) // 3)
    first = (parts[third - 1][2]) / parts[third - 1][0]
    last = (parts[-1][2] - parts[-1 - third][2]) / (parts[-1][0] - parts[-1 - third][0])
    is_timed = parts[third - 1][2] >= LEAST_TIMED_S
    if is_timed and last > 1.2 * first:
        faults.append(f"the last rows take {last / first:.2f} times the first ones' time")
    rms = math.sqrt(sum(x * x for x in z) / len(z)) if z else math.nan
    if is_learned_once and not max(abs(x) for x in z) < 4.0:
        faults.append(f"the end is {max(abs(x) for x in z):.1f} sigma off")
    if not is_learned_once and not 0.8 < rms < 1.2:
        faults.append(f"RMS of error over sigma is {rms:.2f}")
    print(f"{name}: {answered} rows, {1e6 * first:.0f} us a row in the first third, {1e6 * last:.0f} us in the last, "
          f"{full[0][1] / 1024:.0f} to {max(part[1] for part in full) / 1024:.0f} MB once {keep} rows are kept, "
          f"error over sigma {'at the end ' if is_learned_once else ''}{rms:.2f} (RMS of {len(z)})"
          + "".join(f"; FAILS: {fault}" for fault in faults), flush=True)
    return not faults


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("alidade", type=pathlib.Path)
    parser.add_argument("--rows", type=int, default=1000000)
    parser.add_argument("--keep-rows", type=int, default=100000)
    parser.add_argument("--frames", type=int, default=100000, help="of localize, of about thirty rows each")
    parser.add_argument("--commands", default="observe,track,localize")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--verbose", action="store_true", help="memory and time of each part")
    args = parser.parse_args()
    alidade, count, keep, holds = args.alidade.resolve(), args.rows, args.keep_rows, True
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        common = ["--keep-rows", keep, "--no-report", "--out", folder / "out"]
        if "observe" in args.commands:
            errors = Errors(count, observe_pairs)
            words = [alidade, "observe", "-", "--size", "{}x{}".format(*SIZE), *common]
            parts, answered, code = run(words, head_rows(count, args.seed), count, errors)
            if args.verbose:
                print(*parts, "z " + " ".join(f"{z:.2f}" for z in errors.z), sep="\n")
            holds &= held("observe -", parts, answered, count, keep, errors.z, code, True)
        if "track" in args.commands:
            source = TrackSource(alidade, folder, count)
            errors = Errors(997, track_pairs)
            words = [alidade, "track", "-", "--rig", folder / "hour" / "rig.yaml", "--sigma-a", "0.5", *common]
            parts, answered, code = run(words, source.rows(), count, errors)
            if args.verbose:
                print(*parts, sep="\n")
            holds &= held("track -", parts, answered, count, keep, errors.z[3:], code, False)
        if "localize" in args.commands:
            source = WalkSource(folder, args.frames, args.seed)
            words = [alidade, "localize", "-", "--camera", folder / "camera.yaml", "--target", folder / "target.yaml", "--max-points", "40",
                     "--sigma-a", "0.5", "--sigma-alpha", "0.5", "--no-report", "--out", folder / "walk"]
            parts, answered, code = run(words, source.rows(), args.frames, lambda *_: None)
            if args.verbose:
                print(*parts, sep="\n")
            holds &= walk_held(parts, answered, args.frames, folder / "walk" / "poses.csv", code)
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
