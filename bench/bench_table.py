"""The table of a comparison, as Markdown that also reads well on a terminal."""

import dataclasses


@dataclasses.dataclass
class Row:
    what: str
    peers: list
    ours: str
    ratio: float | None  # the peer's time over ours
    goal: str
    reached: bool | None


def seconds_text(seconds):
    if seconds < 0.0995:
        return f"{1e3 * seconds:.3g} ms"
    return f"{seconds:.3g} s"


def _row_cells(row):
    ratio = f"{row.ratio:.3g}" if row.ratio else ""
    reached = {None: "", True: "yes", False: "**no**"}[None if row.reached is None else bool(row.reached)]
    return [row.what, "; ".join(row.peers), row.ours, ratio, row.goal, reached]


def _table(head, rows):
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    lines = [[cell.ljust(width) for cell, width in zip(row, widths)] for row in [head, *rows]]
    lines.insert(1, ["-" * width for width in widths])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def as_markdown(rows, agreements):
    times = _table(["what", "peers", "ours", "ratio", "goal", "reached"], [_row_cells(row) for row in rows])
    same = _table(["case", "peer", "difference from ours"], [list(line) for line in agreements])
    return f"{times}\n\nThe same corners in, the same optimum out:\n\n{same}\n"
