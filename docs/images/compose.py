# SPDX-License-Identifier: Apache-2.0
"""Compose figures of a run into one image: python docs/images/compose.py RUN OUT.png.

`paper.png` is composed from a run of `noninteract demo paper`. `door.png` is `fig5_energy.png` of
`door`, `link.png` that of `delayed_wall`, and `dual_panda.png` is `motion.png` of `dual_panda`.
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.image import imread

FIGURES = ("fig2_cooperative", "fig3_relative", "fig4_storage", "paths")


def main(run: Path, out: Path) -> None:
    """Draw the four figures of a run into one image."""
    figure, axes = plt.subplots(2, 2, figsize=(12, 8.4), layout="constrained")
    for axis, name in zip(axes.flat, FIGURES, strict=True):
        axis.imshow(imread(run / f"{name}.png"))
        axis.axis("off")
    figure.savefig(out, dpi=110)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
