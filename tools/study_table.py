#!/usr/bin/env python3
"""A study's study.json as a page in Markdown; exit code 1 where a goal is missed.

    tools/study_table.py TITLE COMMAND study.json [--from VALUE] > docs/studies-NAME.md

Goals: RMS error at most 1.10 of the bound, 68 ± 4 % inside 1σ, 95 ± 2 % inside 2σ; of a curve from the value on that --from
says: before, the errors are not yet normal."""
import json
import sys


def is_met(point):
    return all(one["rms_over_bound"] <= 1.10 and abs(one["coverage"]["1"] - 0.683) <= 0.04 and abs(one["coverage"]["2"] - 0.954) <= 0.02
               for one in point["quantities"].values())


def value_of(point):
    return f"{point['value']:g}" if "value" in point else ""


def main(title, command, file, begin=None):
    with open(file) as text:
        document = json.load(text)
    estimate = document["estimate"]
    points = estimate.get("curve", [estimate])
    names = list(points[0]["quantities"])
    varied = estimate.get("varied", "")
    print(f"# {title}\n\n`{command}` (`make study`).\n")
    print(f"| {varied} | trials | RMS error over the bound, {' '.join(names)} | inside 1σ [%] | inside 2σ [%] | without an estimate |\n|---|---|---|---|---|---|")
    for point in points:
        figures = list(point["quantities"].values())
        mean = [100 * sum(one["coverage"][k] for one in figures) / len(figures) for k in "12"]
        ratios = " ".join(f"{one['rms_over_bound']:.3f}" for one in figures)
        print(f"| {value_of(point)} | {point['trials']} | {ratios} | {mean[0]:.1f} | {mean[1]:.1f} | {point['trials'] - point['estimates']} |")
    judged = [point for point in points if begin is None or point["value"] >= begin]
    met = all(is_met(point) for point in judged)
    since = f" from {begin:g} on" if begin is not None else ""
    print(f"\nGoals{since} (ratio ≤ 1.10, 68 ± 4 %, 95 ± 2 %, of each quantity): {'met' if met else 'missed'}.")
    return 0 if met else 1


if __name__ == "__main__":
    words = sys.argv[1:]
    begin = float(words[words.index("--from") + 1]) if "--from" in words else None
    sys.exit(main(*words[:3], begin))
