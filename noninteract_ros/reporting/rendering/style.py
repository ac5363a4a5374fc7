# SPDX-License-Identifier: Apache-2.0
"""Style of figures."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

DPI = 150
WIDTH = 6.0  # [in]
# Okabe-Ito palette, safe for colour-blind readers; without yellow, which is faint on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
DASHES = ("--", "-", "-.", ":")
RULES: dict[Any, Any] = {
    "font.size": 9.0,
    "figure.constrained_layout.use": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.prop_cycle": cycler(color=COLOURS),
    "axes.formatter.useoffset": False,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "mathtext.fontset": "dejavusans",
    "path.simplify": True,
}


# Decorator that applies the style to the decorated function only.
styled = mpl.rc_context(RULES)


def new_figure(height: float, rows: int = 1) -> tuple[Figure, list[Axes]]:
    """Create a figure with stacked axes, outside the global state of pyplot.

    Args:
        height: Height [in].
        rows: Number of axes; they share the horizontal axis.
    """
    figure = Figure(figsize=(WIDTH, height))
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    return figure, list(axes)


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG."""
    figure.savefig(path, dpi=DPI)
    return path
