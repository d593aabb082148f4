"""Figures of a result with matplotlib: Axes in, Axes out. Only the tables and grids of the result are drawn."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .board import Board

if TYPE_CHECKING:
    from . import camera as _camera
    from . import result as _result


def _axes(ax: Any, **options: Any) -> Any:
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt  # type: ignore[import]
    return plt.subplots(subplot_kw=options, layout="constrained")[1]


def _image_frame(ax: Any, size: tuple[int, int]) -> None:
    ax.set(xlim=(-0.5, size[0] - 0.5), ylim=(size[1] - 0.5, -0.5), xlabel="u [px]", ylabel="v [px]", aspect="equal")


def _draw_grid(ax: Any, grid: dict[str, Any], values: Any, label: str, **options: Any) -> Any:
    rows, cols = values.shape
    u, v, du, dv = grid["u0_px"], grid["v0_px"], grid["du_px"], grid["dv_px"]
    extent = (u - du / 2, u + (cols - 0.5) * du, v + (rows - 0.5) * dv, v - dv / 2)
    shown = ax.imshow(values, extent=extent, **options)
    ax.figure.colorbar(shown, ax=ax, label=label)
    ax.set(xlabel="u [px]", ylabel="v [px]")
    return ax


class Plots:
    """Of a calibration: residuals(), sigma_map(), coverage(), images(), extrinsics(), diff(); of any result: table()."""

    def __init__(self, result: _result.Result) -> None:
        self._result = result

    def _table(self, name: str) -> Any:
        if name not in self._result.tables:
            raise ValueError(f"this result of {self._result.command} has no table '{name}'")
        return self._result.tables[name]

    def _camera(self) -> _camera.Camera:
        camera = self._result.camera
        if camera is None:
            raise ValueError("there is no camera: " + self._result.verdict.sentence)
        return camera

    def residuals(self, ax: Any = None, scale: float | None = None) -> Any:
        """Residual of each corner, an arrow enlarged `scale` times; rejected corners in red."""
        ax, corners = _axes(ax), self._table("corners")
        seen = np.isfinite(corners["residual_u_px"])
        corners = corners[seen]
        length = np.hypot(corners["residual_u_px"], corners["residual_v_px"])
        if scale is None:
            scale = 0.03 * self._camera().width / max(float(np.median(length)), 1e-9) if len(length) else 1.0
        colours = np.where(corners["weight"] > 0.0, "C0", "C3")
        ax.quiver(corners["u_px"], corners["v_px"], corners["residual_u_px"], corners["residual_v_px"], angles="xy",
                  scale_units="xy", scale=1.0 / scale, color=colours, width=0.0015)
        _image_frame(ax, self._camera().size)
        ax.set_title(f"residuals, {scale:.0f} times, RMS {self._result.rms_px:.3f} px")
        return ax

    def sigma_map(self, ax: Any = None, at: str = "working") -> Any:
        """σ of projection over the image [px]; `at` "working" (distance) or "infinity"."""
        name = "sigma_" + at
        if name not in self._result.grids:
            raise ValueError(f"at: there is no map '{at}'; there are working and infinity")
        grid = self._result.grids[name]
        ax = _draw_grid(_axes(ax), grid, grid["sigma_px"], "σ of projection [px]", cmap="viridis")
        ax.set_title("σ of projection")
        return ax

    def coverage(self, ax: Any = None) -> Any:
        """Where corners were seen, a colour for each photo."""
        ax, corners = _axes(ax), self._table("corners")
        ax.scatter(corners["u_px"], corners["v_px"], c=corners["photo"], s=5, cmap="tab20")
        _image_frame(ax, self._camera().size)
        ax.set_title("corners")
        return ax

    def images(self, ax: Any = None) -> Any:
        """RMS residual of each photo [px]; those not used are grey."""
        ax, photos = _axes(ax), self._table("photos")
        used = photos["used"].astype(bool)
        ax.barh(np.arange(len(photos)), np.where(used, photos["rms_px"], 0.0))
        ax.set_yticks(np.arange(len(photos)), labels=photos["name"])
        for label, is_used in zip(ax.get_yticklabels(), used):
            label.set_color("black" if is_used else "grey")
        ax.invert_yaxis()
        ax.set(xlabel="RMS [px]", title="photos")
        return ax

    def extrinsics(self, ax: Any = None) -> Any:
        """The boards before the camera, from above: x to the right, z forward [m]."""
        ax, photos = _axes(ax), self._table("photos")
        board = dict(self._result.estimate["board"])
        in_board = Board((board.pop("cols"), board.pop("rows")), board_kind=board.pop("kind"), **board).points
        for row in photos[photos["used"].astype(bool)]:
            x, y, z, w = (row["cam_from_board_" + name] for name in ("qx", "qy", "qz", "qw"))
            rotation = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                                 [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                                 [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
            in_cam = in_board @ rotation.T + [row["cam_from_board_" + name] for name in ("x_m", "y_m", "z_m")]
            ax.plot(in_cam[:, 0], in_cam[:, 2], ".-", markersize=2, linewidth=0.5)
        ax.plot(0.0, 0.0, "k^")
        ax.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="boards before the camera, from above")
        return ax

    def diff(self, other: Any, ax: Any = None) -> Any:
        """How far the camera of another result (or a Camera) is from this one over the image [px]."""
        camera = self._camera()
        second = other if hasattr(other, "project") else other.camera
        found = camera.diff(second)
        u, v = found["delta_u_px"], found["delta_v_px"]
        grid = {"u0_px": u["u_px"], "v0_px": u["v_px"], "du_px": u["du_px"], "dv_px": u["dv_px"]}
        ax = _draw_grid(_axes(ax), grid, np.hypot(u["values"], v["values"]), "difference [px]", cmap="magma")
        ax.set_title(f"difference, RMS {found['rms_px']:.3f} px")
        return ax

    def table(self, name: str, x: str, *columns: str, ax: Any = None) -> Any:
        """Columns of a table over another: r.plot.table("intrinsics", "t_s", "fx", "fy"); with bands of 3σ where the table
        has sigma_ columns."""
        ax, values = _axes(ax), self._table(name)
        for column in (x, *columns):
            if column not in (values.dtype.names or ()):
                raise ValueError(f"table {name} has no column '{column}'; it has {', '.join(values.dtype.names or ())}")
        for column in columns:
            line, = ax.plot(values[x], values[column], label=column)
            if "sigma_" + column in values.dtype.names:
                bound = 3.0 * values["sigma_" + column]
                ax.fill_between(values[x], values[column] - bound, values[column] + bound, alpha=0.2, color=line.get_color())
        ax.set(xlabel=x)
        ax.legend()
        return ax
