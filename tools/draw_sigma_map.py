#!/usr/bin/env python3
"""Draws the σ map of a calibration with its corners as SVG: tools/draw_sigma_map.py RESULT.json > MAP.svg"""
import json
import sys

LEVELS = [(0.1, "#00224e"), (0.2, "#2b446e"), (0.3, "#575d6d"), (0.5, "#7c7b78"), (1.0, "#a59c74"), (2.0, "#d2c060"),
          (float("inf"), "#fee838")]  # cividis; upper end of 3σ in px
LEGEND_PX = 26


def colour(sigma):
    """Of a value of the grid; None where the lens is not valid."""
    return None if sigma is None else next(colour for most, colour in LEVELS if 3 * sigma <= most)


def runs(row):
    """(first, past the last, colour) of equal neighbours."""
    start = 0
    for i in range(1, len(row) + 1):
        if i == len(row) or row[i] != row[start]:
            yield start, i, row[start]
            start = i


def cells(grid):
    du, dv = grid["du_px"], grid["dv_px"]
    for line in range(grid["rows"]):
        values = grid["sigma_px"][line * grid["cols"]:(line + 1) * grid["cols"]]
        for start, end, fill in runs([colour(value) for value in values]):
            if fill:
                left, top = grid["u0_px"] + (start - 0.5) * du, grid["v0_px"] + (line - 0.5) * dv
                yield (f'<rect x="{left:.1f}" y="{top:.1f}" width="{(end - start) * du + 0.3:.1f}" '
                       f'height="{dv + 0.3:.1f}" fill="{fill}"/>')


def legend(width, height):
    step = width / len(LEVELS)
    for i, (most, fill) in enumerate(LEVELS):
        text = f"≤ {most:g}" if most < float("inf") else f"> {LEVELS[i - 1][0]:g} px"
        yield (f'<rect x="{i * step:.1f}" y="{height}" width="{step:.1f}" height="{LEGEND_PX}" fill="{fill}"/>'
               f'<text x="{(i + 0.5) * step:.1f}" y="{height + 18}" text-anchor="middle" '
               f'fill="{"#fff" if i < 3 else "#000"}">3σ {text}</text>')


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        result = json.load(file)
    camera = result["estimate"]["camera"]
    width, height = camera["width"], camera["height"]
    corners = result["data"]["corners"]
    print(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-0.5 -0.5 {width} {height + LEGEND_PX}" '
          f'font-family="sans-serif" font-size="13" role="img">')
    print("<title>3σ of where a far point is seen, over the image, with the corners that it comes from</title>")
    print(f'<rect x="-0.5" y="-0.5" width="{width}" height="{height}" fill="#fff"/>')
    print("\n".join(cells(result["grids"]["sigma_infinity"])))
    dots = "".join(f"M{u:.0f} {v:.0f}h0" for u, v in zip(corners["u_px"], corners["v_px"]))
    print(f'<path d="{dots}" stroke="#fff" stroke-width="2.4" stroke-linecap="round" opacity="0.75"/>')
    print("\n".join(legend(width, height)))
    print("</svg>")


if __name__ == "__main__":
    main()
