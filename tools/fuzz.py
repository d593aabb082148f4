#!/usr/bin/env python3
"""Fuzzes everything that reads what others wrote: tools/fuzz.py ALIDADE FUZZ_BUILD --minutes N [--seconds N each]
[--readers a,b]. Seeds are files that ALIDADE itself makes (simulated measurements, cameras in every format); a reader
starts from them and from what earlier runs found worth keeping (FUZZ_BUILD/corpus). Inputs that crash, hang for more than a
second or take more than 512 MB stand in FUZZ_BUILD/findings, and the exit code is 1: keep them in fuzz/found."""
import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

SEEDS = {  # reader: files of the simulations below
    "board_points": ["*/board_points.csv"],
    "camera": ["*/camera.yaml", "cameras/*"],
    "camera_parts": ["cameras/*"],
    "config": ["config/*"],
    "corners": ["*/corners.csv"],
    "events": ["track/*.csv"],
    "fleet": ["fleet/*"],
    "head_url": ["urls/*"],
    "indi": ["indi/*"],
    "intrinsics_history": ["track/*intrinsics*", "rotation/*intrinsics*"],
    "live_message": ["messages/*"],
    "observations": ["underwater/*.csv"],
    "onvif": ["onvif/*"],
    "pairs": ["*/pairs.csv"],
    "path": ["underwater/*.tum", "underwater/*.txt"],
    "photo": ["photos/*", "board/*.png"],
    "result": ["results/*"],
    "rig": ["*/rig.yaml"],
    "rotctl": ["rotctl/*"],
    "rotation_log": ["rotation/*.csv"],
    "scan": ["*/scan*.csv"],
    "scenario": ["scenario/*"],
    "beam": ["*/rangefinder.yaml", "*/beam.yaml"],
    "servo_log": ["servo/*.csv"],
    "shots": ["rangefinder/*.csv"],
    "start": ["*/start.yaml"],
    "table": ["*/*.csv"],
    "target": ["*/target.yaml"],
    "views": ["rig/*.csv"],
}
SIMULATIONS = {
    "board": "simulate board --board 9x6 --square 0.025 --photos 2 --size 160x120",
    "rotation": "simulate rotation --duration 1",
    "rangefinder": "simulate rangefinder --shots 4",
    "rig": "simulate rig",
    "track": "simulate track",
    "servo": "simulate servo",
    "underwater": "simulate underwater --frames 5",
}
PHOTO = """
import cv2, numpy, sys
image = (numpy.indices((12, 16)).sum(0) * 9).astype(numpy.uint8)
for name in ("a.png", "a.jpg", "a.tiff", "a.webp", "a.bmp", "a.pgm"): cv2.imwrite(f"{sys.argv[1]}/{name}", image)
cv2.imwrite(f"{sys.argv[1]}/b.png", numpy.dstack([image] * 3).astype(numpy.uint16) * 200)
"""
MESSAGES = ['{"op":"subscribe","subscriptions":[{"id":1,"channelId":2}]}', '{"op":"unsubscribe","subscriptionIds":[1]}',
            "foxglove.sdk.v1, foxglove.websocket.v1", "localhost:8765", "/result.json?token=0123&a=b"]

FLEET = ['{"n":1,"t":0.5,"pan":0.1,"tilt":-0.02,"p1x":320.5,"p1y":240.25,"p2x":100,"p2y":null}',
         '{"n":7,"t":3,"qw":1,"qx":0,"qy":0,"qz":0,"p1x":1,"p1y":2}', '{"n":2,"t":1,"omega_x":0.1,"omega_y":0,"omega_z":0}']
URLS = ["127.0.0.1:4533", "[::1]:80/path", "rate=30&accel=100&backlash=0.1&lie=frozen&seed=3", "size=320x240&fx=350&mount=1:2:3&fps=12&target=2:0:0:10:1"]
INDI = ['<defNumberVector device="Rotator" name="ABS" state="Ok"><defNumber name="ANGLE" format="%g" min="0" max="360">12:30:15'
        '</defNumber></defNumberVector>\n<message device="Rotator" message="hello"/>', '<?xml version="1.0"?><delProperty device="a" name="b"/>']
ROTCTL = ["p\nP 30.5 -10\nS\n\\dump_state\n_\nK\n", "\\set_pos 1e300 0\nP nan 0\n\\get_pos\n\\stop\n\\park\nq\n"]
SOAP = ('<s:Envelope xmlns:s="http://www.w3.org/2003/05/soap-envelope"><s:Header><Security><UsernameToken><Username>somebody</Username>'
        '<Password>YWJj</Password><Nonce>YWJj</Nonce><Created>2026-01-31T12:00:00Z</Created></UsernameToken></Security></s:Header>'
        '<s:Body>%s</s:Body></s:Envelope>')
ONVIF = [SOAP % body for body in (
    "<GetProfiles/>", '<AbsoluteMove><ProfileToken>p</ProfileToken><Position><PanTilt x="0.5" y="-0.1"/><Zoom x="0.3"/></Position></AbsoluteMove>',
    '<ContinuousMove><Velocity><PanTilt x="1" y="0"/></Velocity><Timeout>PT1.5S</Timeout></ContinuousMove>', "<Stop/>", "<GetStatus/>",
    "<GetSystemDateAndTime/>", "<GetCapabilities/>", "<GetStreamUri/>")]


def run(*words, cwd=None):
    return subprocess.run([str(word) for word in words], cwd=cwd, capture_output=True, text=True)


def make_sources(alidade, folder):
    """What ALIDADE simulates, small; a simulation that this version does not take is passed over, and said."""
    for name, command in SIMULATIONS.items():
        done = run(alidade, *command.split(), "--seed", 1, "--out", folder / name)
        if done.returncode:
            print(f"fuzz: seeds: alidade {command}: exit {done.returncode}: {done.stderr.strip()[:100]}", file=sys.stderr)
    for part in ("cameras", "photos", "messages", "config", "results", "scenario", "fleet", "urls", "indi", "rotctl", "onvif"):
        (folder / part).mkdir()
    camera = next(iter(sorted(folder.glob("*/camera.yaml"))), None)
    if camera:
        for form in ("alidade", "opencv", "ros", "kalibr", "mrcal", "colmap"):
            run(alidade, "camera", "convert", camera, folder / "cameras" / form, "--to", form, "--lossy")
    run("/usr/bin/python3", "-c", PHOTO, folder / "photos")
    for part, texts in {"messages": MESSAGES, "fleet": FLEET, "urls": URLS, "indi": INDI, "rotctl": ROTCTL, "onvif": ONVIF}.items():
        for number, text in enumerate(texts):
            (folder / part / str(number)).write_text(text)
    (folder / "config" / "board").write_text("board: 9x6\nsquare_m: 25mm\ndictionary: DICT_4X4_50\nmarker_m: 0.01\n")
    help_text = run(alidade, "servo", "--help").stdout.partition("they then have:")[2].partition("Usage:")[0]
    (folder / "scenario" / "default").write_text(re.sub(r"^  ", "", help_text, flags=re.MULTILINE))
    run(alidade, "observe", *sorted((folder / "rotation").glob("*.csv"))[:1], "--size", "640x480", "--out", folder / "o")
    for result in sorted(folder.glob("*/result.json")):
        (folder / "results" / result.parent.name).write_bytes(result.read_bytes())


def make_seeds(alidade, corpus, readers):
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        make_sources(alidade, folder)
        for reader in readers:
            (corpus / reader).mkdir(parents=True, exist_ok=True)
            for number, file in enumerate(sorted({f for g in SEEDS.get(reader, []) for f in folder.glob(g)})):
                if file.is_file():
                    # Small seeds are mutated a hundred times as often: a few lines of a table are enough.
                    content = file.read_bytes()
                    if file.suffix == ".csv":
                        content = b"".join(content.splitlines(keepends=True)[:8])
                    (corpus / reader / f"seed-{number}").write_bytes(content[:20000])


def words_of(reader, corpus, file):
    """libFuzzer's dictionary: the words that the seeds are made of."""
    words = set()
    for seed in (corpus / reader).glob("seed-*"):
        words |= set(re.findall(rb"[A-Za-z_][\w]{2,30}", seed.read_bytes()[:4000]))
    words |= {b"nan", b"inf", b"-0", b"1e300", b"1e-300", b"\\xef\\xbb\\xbf", b"\\x00"}
    file.write_text("".join(f'"{word.decode()}"\n' for word in sorted(words)))


def is_slow(program, finding):
    """Whether it takes more than a second of the processor's time: on a busy machine the clock alone says little."""
    before = os.times().children_user
    done = subprocess.run([str(program), "-timeout=60", str(finding)], capture_output=True)
    return done.returncode != 0 or os.times().children_user - before > 1.0


def fuzz(build, reader, seconds):
    """One reader for so long. (reader, executions, coverage, findings)"""
    corpus, findings = build / "corpus", build / "findings"
    program, dictionary, log = build / f"fuzz_{reader}", build / f"{reader}.dict", build / f"{reader}.log"
    words_of(reader, corpus, dictionary)
    found = (pathlib.Path(__file__).parent.parent / "fuzz" / "found" / reader)
    before = set(findings.glob(f"{reader}-*"))
    left, executions, coverage = seconds, 0, 0
    while left >= 1:  # a finding ends a run: the next goes on
        begun = time.monotonic()
        with open(log, "w") as out:
            done = subprocess.run(
                [str(program), str(corpus / reader), *([str(found)] if found.is_dir() else []), f"-dict={dictionary}",
                 f"-max_total_time={int(left)}", "-timeout=10", "-report_slow_units=2", "-rss_limit_mb=512",
                 "-max_len=65536" if reader == "photo" else "-max_len=4096", f"-artifact_prefix={findings}/{reader}-",
                 "-print_final_stats=1"],
                stdout=out, stderr=subprocess.STDOUT,
                env={**os.environ, "ASAN_OPTIONS": "quarantine_size_mb=16:detect_leaks=1", "UBSAN_OPTIONS": "print_stacktrace=1"})
        text = log.read_text(errors="replace")
        executions += int((re.findall(r"stat::number_of_executed_units:\s*(\d+)", text) or re.findall(r"^#(\d+)", text, re.M) or [0])[-1])
        coverage = int((re.findall(r"cov: (\d+)", text) or [0])[-1])
        for finding in set(findings.glob(f"{reader}-timeout-*")) | set(findings.glob(f"{reader}-slow-unit-*")):
            if finding not in before and not is_slow(program, finding):
                finding.unlink()
        left -= time.monotonic() - begun
        if done.returncode == 0 or len(set(findings.glob(f"{reader}-*")) - before) >= 5:
            break
    return reader, executions, coverage, sorted(set(findings.glob(f"{reader}-*")) - before)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("alidade", type=pathlib.Path)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--minutes", type=float, default=0.0)
    parser.add_argument("--seconds", type=float, default=0.0, help="for each reader")
    parser.add_argument("--readers", default="")
    args = parser.parse_args()
    alidade, build = args.alidade.resolve(), args.build.resolve()
    readers = [line.removeprefix("fuzz_") for line in run(build / "alidade_fuzz").stderr.split() if line.startswith("fuzz_")]
    if args.readers:
        readers = args.readers.split(",")
    for reader in readers:
        link = build / f"fuzz_{reader}"
        if not link.exists():
            os.link(build / "alidade_fuzz", link)
        elif not link.samefile(build / "alidade_fuzz"):
            link.unlink()
            os.link(build / "alidade_fuzz", link)
    (build / "findings").mkdir(exist_ok=True)
    make_seeds(alidade, build / "corpus", readers)
    workers = os.cpu_count() or 1
    seconds = args.seconds or max(1.0, 60.0 * args.minutes * workers / len(readers))
    total, bad = 0, 0
    summary = []
    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        for reader, executions, coverage, findings in pool.map(lambda name: fuzz(build, name, seconds), readers):
            total += executions
            bad += len(findings)
            summary.append({"reader": reader, "executions": executions, "coverage": coverage, "findings": len(findings)})
            print(f"{reader:14} {executions:12,} executions, {coverage:6} branches reached, {len(findings)} findings", flush=True)
            for finding in findings:
                print(f"  {finding}")
    (build / "summary.json").write_text(json.dumps(summary, indent=1))
    print(f"fuzz: {len(readers)} readers, {total:,} executions, {bad} findings")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
