#!/usr/bin/env python3
"""Faults of the machine under every command that writes: tools/faults.py ALIDADE [--short] [--seed N] [--commands a,b]
[--campaigns calls,kill,together,pipe] [--kinds open,malloc] [--most N]. What must hold after each fault: it is answered by exit code 1 or 3
and one line (or nothing was lost by it: 0), within seconds, and the folder of results has the whole old result or the whole new one, with
nothing beside it."""
import argparse
import collections
import errno
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

SIMULATED = {
    "board": "simulate board --board 7x5 --square 0.03 --corners-only --photos 8 --size 320x240",
    "rotation": "simulate rotation --duration 3",
    "rangefinder": "simulate rangefinder --shots 12",
    "rig": "simulate rig --boards 2",
    "track": "simulate track --duration 2",
    "servo": "simulate servo",
    "underwater": "simulate underwater --frames 20",
}
# {s} is a folder of what is simulated; each writes --out. Old and new results are of two seeds.
COMMANDS = {
    "simulate": "simulate track --duration 1 --seed {n}",
    "photos": "simulate board --board 5x4 --square 0.03 --photos 2 --size 160x120 --seed {n}",
    "calibrate": "calibrate --corners {s}/board/corners.csv --size 320x240 --board 7x5 --square 0.03",
    "observe": "observe {s}/rotation/log.csv --size 780x582",
    "rangefinder": "rangefinder {s}/rangefinder/shots.csv --corners {s}/rangefinder/corners.csv --board 9x6 --square 0.04 --camera {s}/rangefinder/camera.yaml",
    "track": "track {s}/track/events.csv --rig {s}/track/rig.yaml",
    "identify": "identify {s}/servo/log.csv",
    "localize": "localize {s}/underwater/sights.csv --camera {s}/underwater/camera.yaml --target {s}/underwater/target.yaml",
}
ALL = 0
KINDS = {  # the call, errno of its failure, and how many fail from that one on
    "open": ("open", errno.EMFILE, 1), "write": ("write", errno.ENOSPC, ALL), "rename": ("rename", errno.EACCES, 1),
    "renames": ("rename", errno.EACCES, ALL), "mkdir": ("mkdir", errno.EROFS, 1), "sync": ("sync", errno.EIO, 1),
    "mmap": ("mmap", errno.ENOMEM, 1), "malloc": ("malloc", errno.ENOMEM, 1),
    "mallocs": ("malloc", errno.ENOMEM, 5), "memory": ("malloc", errno.ENOMEM, ALL),  # one fewer is served from a reserve
}
HIDDEN = ".alidade-"  # what a killed process leaves, until the next run clears it away
VOLATILE = ("result.json", "report.html")  # have the time in them


def contents(folder, with_hidden=True):
    """Name to bytes of a folder, None if there is none; what changes with time is only named."""
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    found = {str(file.relative_to(folder)): b"" if file.name in VOLATILE else file.read_bytes() for file in files}
    if not with_hidden:
        found = {name: content for name, content in found.items() if not name.startswith(HIDDEN)}
    return found if found or (with_hidden and folder.exists()) else None


class Trial:
    """One command with its old result and its new one, tried again and again."""

    def __init__(self, alidade, name, simulated, folder):
        self.alidade, self.name, self.folder = alidade, name, folder
        self.words = {n: COMMANDS[name].format(s=simulated / str(n), n=n).split() for n in (1, 2)}
        self.base = folder / name
        self.base.mkdir()
        self.out = self.base / "out"
        self.old = self.base / "old"  # of another seed, so that old and new differ
        self.problems = []
        self.finished = self.run(seed=2).returncode in (0, 4, 6) and self.out.exists()
        if self.finished:
            self.old_content = contents(self.out)
            self.out.rename(self.old)
            self.seconds = min(self.seconds_of_a_run() for _ in range(5))  # of a busy machine's runs the least: others end before the kill
            self.new_content = contents(self.out)
            for path in self.base.iterdir():
                if path not in (self.old,):
                    shutil.rmtree(path)

    def line(self, seed=1):
        return [str(self.alidade), *self.words[seed], "--out", str(self.out)]

    def run(self, seed=1, **environment):
        return subprocess.run(self.line(seed), cwd=self.base, capture_output=True, text=True, errors="replace", timeout=60,
                              env={**os.environ, **environment})

    def seconds_of_a_run(self):
        begun = time.monotonic()
        self.run()
        return time.monotonic() - begun

    def begin(self, with_old):
        shutil.rmtree(self.out, ignore_errors=True)
        if with_old:
            shutil.copytree(self.old, self.out)

    def check_end(self, what, code, error, codes=(0, 1, 3, 4, 6)):
        lines = [line for line in error.splitlines() if line.strip()]
        if code not in codes or (code in (1, 3) and len(lines) != 1):
            self.problems.append(f"{what}: exit {code}: {' | '.join(lines)[:200]}")

    def check(self, what, code=None, error="", output="", codes=(0, 1, 3, 4, 6)):
        """What the folder holds after a fault, and what was said."""
        found = contents(self.out, with_hidden=code != 0)  # where only clearing up failed, the next run does it
        is_whole = found is None or found in (self.old_content, self.new_content) or (
            "report: not written" in error + output and {**found, "report.html": b""} in (self.old_content, self.new_content))
        beside = [path.name for path in self.base.iterdir() if path not in (self.out, self.old)]
        if code is not None:
            self.check_end(what, code, error, codes)
        if not is_whole:
            near = min((self.old_content, self.new_content), key=lambda c: len(set(c) ^ set(found)))
            differ = sorted(k for k in set(near) | set(found) if near.get(k) != found.get(k))
            self.problems.append(f"{what}: exit {code}: the folder is neither old nor new: {differ[:5]}")
        if beside:
            self.problems.append(f"{what}: exit {code}: left beside the folder: {beside}")
            for name in beside:
                path = self.base / name
                shutil.rmtree(path) if path.is_dir() else path.unlink()


def chosen_calls(count, most, generator):
    if most == 0 or count <= most:
        return list(range(1, count + 1))
    return sorted(generator.sample(range(1, count + 1), most))


def check_set_aside(trial, what, code):
    """An exchange that could not be undone: every older file is still somewhere, and the next run finds its way."""
    found = contents(trial.out)
    lost = [name for name, content in trial.old_content.items()
            if not any((f"/{there}").endswith(f"/{name}") and there_content == content for there, there_content in found.items())]
    if code != 3 or lost or "result.json" in found:
        trial.problems.append(f"{trial.name}: {what}: exit {code}, lost: {lost}")
    check_next_run(trial, what)


def fail_calls(trial, shim, generator, kinds, most):
    """Every n-th call of each kind fails, or a sample of them."""
    log = trial.folder / "log"
    done = collections.Counter()
    for kind in kinds:
        call, number, in_a_row = KINDS[kind]
        faults = {"LD_PRELOAD": str(shim), "FAIL_CALL": call, "FAIL_ERRNO": str(number), "FAIL_LOG": str(log), "FAIL_COUNT": str(in_a_row)}
        trial.begin(False)
        trial.run(**faults)
        count = int(log.read_text().split()[0])
        if kind == "sync" and count < len(trial.new_content):  # a power cut would lose what the system has not written yet
            trial.problems.append(f"{trial.name}: {count} calls of fsync for {len(trial.new_content)} files")
        first = 1
        if call == "malloc" and most == 0:
            first = 1 + fail_in_copies(trial, kind, faults)
            done[kind] += first - 1
        for nth in chosen_calls(count, most, generator):
            if nth < first:
                continue
            trial.begin(kind == "renames" or nth % 2 == 0)
            try:
                ended = trial.run(**faults, FAIL_NTH=str(nth))
                if kind == "memory":  # nor can anything be cleared away: as after a kill
                    what = f"memory {nth} of {count} and all after it fail"
                    trial.check_end(f"{trial.name}: {what}", ended.returncode, ended.stderr)
                    check_killed(trial, what)
                    check_next_run(trial, what)
                elif kind == "renames" and contents(trial.out) != trial.old_content:  # nothing can be undone either
                    check_set_aside(trial, f"rename {nth} of {count} and all after it fail", ended.returncode)
                else:
                    trial.check(f"{trial.name}: {kind} {nth} of {count} fails", ended.returncode, ended.stderr, ended.stdout)
            except subprocess.TimeoutExpired:
                trial.problems.append(f"{trial.name}: {kind} {nth} of {count} fails: hangs")
            done[kind] += 1
    return done


def fail_in_copies(trial, kind, faults):
    """Every call until the first file is opened for writing fails in a copy of one process. How many these are."""
    trial.begin(False)
    copies, said = trial.folder / "copies", trial.folder / "said"
    one_processor = {min(os.sched_getaffinity(0))}  # TBB then starts no threads, which a copy would not have
    with open(said, "w") as file:
        subprocess.run(trial.line(), cwd=trial.base, stdout=subprocess.DEVNULL, stderr=file, preexec_fn=lambda: os.sched_setaffinity(0, one_processor),
                       env={**os.environ, **faults, "FAIL_FORK": str(copies)})
    calls, ends = 0, collections.defaultdict(list)
    for line in copies.read_text().splitlines():
        calls, status, lines = (int(word) for word in line.split())
        code = os.waitstatus_to_exitcode(status)
        if code not in (0, 1, 3, 4, 6, 77) or (code in (1, 3) and lines != 1):
            ends[f"exit {code}, {lines} lines"].append(calls)
    for end, numbers in ends.items():
        trial.problems.append(f"{trial.name}: {kind} fails: {end}: {len(numbers)} times, from {numbers[0]} to {numbers[-1]}")
    return calls


def check_killed(trial, what):
    """Old or new and whole; in the middle of an exchange there is no result.json: nobody takes the rest for a result."""
    found = contents(trial.out, with_hidden=False)
    if found is not None and found not in (trial.old_content, trial.new_content) and "result.json" in found:
        trial.problems.append(f"{trial.name}: {what}: the folder is neither old nor new")


def check_next_run(trial, what):
    """The run after a kill, left alone, works and clears away what was left."""
    ended = trial.run()
    trial.check(f"{trial.name}: after {what}", ended.returncode, ended.stderr)
    if contents(trial.out) != trial.new_content:
        trial.problems.append(f"{trial.name}: after {what}: not the new result")


def kill(trial, generator, times):
    """kill -9 at random instants of so many running processes; then a run that is left alone must work. Those that came too late
    are not counted: how long a run takes is followed, as it changes with what else the machine does, one in ten being too late."""
    done, span = 0, 1.1 * trial.seconds
    for _ in range(4 * times):
        if done == times:
            break
        trial.begin(generator.random() < 0.5)
        started = subprocess.Popen(trial.line(), cwd=trial.base, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(generator.random() * span)
        started.send_signal(signal.SIGKILL)
        was_running = started.wait() == -signal.SIGKILL
        done += was_running
        span *= 1.01 if was_running else 0.9
        check_killed(trial, "killed")
    check_next_run(trial, "kills")
    return {"kill": done}


def kill_at_calls(trial, shim, generator, most):
    """kill -9 just before each call that changes the disk: random instants seldom meet these. The next run must work each time."""
    log, done = trial.folder / "log", 0
    for kind in ("open", "write", "rename", "mkdir", "sync"):
        environment = {"LD_PRELOAD": str(shim), "FAIL_CALL": kind, "FAIL_LOG": str(log)}
        trial.begin(True)
        trial.run(**environment)
        for nth in chosen_calls(int(log.read_text().split()[0]), most, generator):
            what = f"kill before {kind} {nth}"
            for with_old in (False, True):
                trial.begin(with_old)
                if trial.run(**environment, FAIL_NTH=str(nth), FAIL_KILL="1").returncode == -signal.SIGKILL:
                    check_killed(trial, what)
                    check_next_run(trial, what)
                    done += 1
    return {"kill at a call": done}


def kill_twice(trial, shim, most):
    """The run that finds what a killed one left is killed in turn, before each rename of each."""
    log, done = trial.folder / "log", 0
    environment = {"LD_PRELOAD": str(shim), "FAIL_CALL": "rename", "FAIL_LOG": str(log)}
    trial.begin(True)
    trial.run(**environment)
    count = int(log.read_text().split()[0])
    for first in range(2, min(count, most or count) + 1):
        for second in range(1, count + 1):
            trial.begin(True)
            for nth in (first, second):
                trial.run(**environment, FAIL_NTH=str(nth), FAIL_KILL="1")
                check_killed(trial, f"kill before rename {first}, then {second}")
                done += 1
            check_next_run(trial, f"kill before rename {first}, then {second}")
    return {"kill at a call": done}


def together(trial, count):
    """Many runs into one folder: in the end it has one whole result."""
    trial.begin(True)
    runs = [subprocess.Popen(trial.line(), cwd=trial.base, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            for _ in range(count)]
    for each in runs:
        error = each.communicate(timeout=300)[1]
        if each.returncode not in (0, 2, 3, 4) or (each.returncode == 3 and len(error.strip().splitlines()) != 1):
            trial.problems.append(f"{trial.name}: {count} at once: exit {each.returncode}: {error[:200]}")
    trial.check(f"{trial.name}: {count} at once")
    if contents(trial.out) != trial.new_content:
        trial.problems.append(f"{trial.name}: {count} at once: no whole new result")
    return {"together": count}


def closed_pipe(trial):
    """Standard output that nobody reads, or that is full: the result is written all the same, or it is said."""
    for name, target in (("closed", None), ("full", "/dev/full")):
        trial.begin(False)
        if target:
            with open(target, "w") as full:
                ended = subprocess.run(trial.line(), cwd=trial.base, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
        else:
            reading, writing = os.pipe()
            os.close(reading)
            ended = subprocess.run(trial.line(), cwd=trial.base, stdout=writing, stderr=subprocess.PIPE, text=True, timeout=60)
            os.close(writing)
        trial.check(f"{trial.name}: standard output {name}", ended.returncode, ended.stderr)
    return {"pipe": 2}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("alidade", type=pathlib.Path)
    parser.add_argument("--short", action="store_true", help="a sample of each, for the tests")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--commands", default=",".join(COMMANDS))
    parser.add_argument("--campaigns", default="calls,kill,together,pipe")
    parser.add_argument("--kinds", default=",".join(KINDS), help="of calls that fail")
    parser.add_argument("--most", type=int, help="failing calls of a kind, a sample where there are more (200; 0: all); kills (1000)")
    args = parser.parse_args()
    generator = random.Random(args.seed)
    alidade = args.alidade.resolve()
    total, problems = collections.Counter(), []

    def most(usual):
        return 2 if args.short else usual if args.most is None else args.most

    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        shim = folder / "fail_nth.so"
        source = pathlib.Path(__file__).parent / "fail_nth.c"
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", str(shim), str(source), "-ldl"], check=True)
        simulated = folder / "simulated"
        for name, command, seed in [(n, c, s) for n, c in SIMULATED.items() for s in "12"]:
            done = subprocess.run([str(alidade), *command.split(), "--seed", seed, "--out", str(simulated / seed / name)],
                                  capture_output=True, text=True)
            if done.returncode:
                problems.append(f"alidade {command}: exit {done.returncode}: {done.stderr.strip()}")
        for name in args.commands.split(","):
            trial = Trial(alidade, name, simulated, folder)
            if not trial.finished:
                ended = trial.run()
                problems.append(f"{name}: exit {ended.returncode} without any fault: {ended.stderr.strip()[:200]}")
                continue
            done = collections.Counter()
            if "calls" in args.campaigns:
                done.update(fail_calls(trial, shim, generator, args.kinds.split(","), most(200)))
            if "kill" in args.campaigns:
                done.update(kill(trial, generator, most(1000)))
                done.update(kill_at_calls(trial, shim, generator, 1 if args.short else 0))
                done.update(kill_twice(trial, shim, 2 if args.short else 0))
            if "together" in args.campaigns:
                done.update(together(trial, 4 if args.short else 64))
            if "pipe" in args.campaigns:
                done.update(closed_pipe(trial))
            total.update(done)
            print(f"{name:12} {len(trial.problems)} problems;", ", ".join(f"{count} {kind}" for kind, count in done.items()), flush=True)
            for problem in trial.problems[:20]:
                print(f"  {problem}", flush=True)
            problems += trial.problems
    print("faults:", ", ".join(f"{count} {kind}" for kind, count in total.items()))
    print(f"faults: {sum(total.values())} in all, {len(problems)} problems")
    for problem in problems:
        if "without any fault" in problem or problem.startswith("alidade"):
            print(f"  {problem}")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
