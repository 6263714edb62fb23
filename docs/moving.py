"""The moving picture of README and landing page: a person whose intervals close in on the predicted one.

Drawn from a log: the body in the plane of its motion, and behind it the one that the controller's hold predicts, both
with their angles enlarged; beside it the hold error, which rises to the threshold and is reset by an event, and the
intervals between events.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from PIL import Image

import icmj

FRAMES_PER_SECOND, SECONDS, REST = 10, 10.0, 2.5  # the last frame stays for REST seconds
COLOURS = 24
LARGER = 15.0  # angles, for the eye
LENGTHS, FOOT, HEAD = (0.443, 0.441, 0.52), (-0.06, 0.19), 0.11  # m, of models/three_link.xml
INK, PAPER, BODY, GHOST, EVENT = "#333333", "#ffffff", "#0072b2", "#c9c9c9", "#d55e00"


@dataclass(frozen=True)
class Figures:
    """What is drawn of one body: the line of its joints, and its head."""

    line: plt.Line2D
    head: plt.Line2D

    def pose(self, angles: np.ndarray) -> None:
        """Stand as joint angles [rad] say, shape (3,), each relative to the segment below, forwards positive."""
        lean = np.cumsum(LARGER * angles)
        x = np.concatenate([[0.0], np.cumsum(np.sin(lean) * LENGTHS)])
        z = np.concatenate([[0.0], np.cumsum(np.cos(lean) * LENGTHS)])
        self.line.set_data(x, z)
        self.head.set_data([x[-1] + 1.4 * HEAD * np.sin(lean[-1])], [z[-1] + 1.4 * HEAD * np.cos(lean[-1])])


def draw_moving(log: Path, to: Path, still: bool = False) -> None:
    """Write the loop as a GIF, or its last frame as a PNG.

    Args:
        log: a log of the three-link person.
        to: the file to write.
        still: only the last frame.
    """
    result = icmj.read_log(log)
    run, rule = result.simulation, result.controller.trigger
    delta_crit, threshold = result.prediction.delta_crit, np.degrees(rule.q_t)
    error = np.degrees(np.sqrt(np.maximum(run.E + rule.q_t**2, 0.0)))  # E = e'Q_t e - q_t²
    figure = plt.figure(figsize=(7.2, 3.4), dpi=100, facecolor=PAPER)
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.9), left=0.02, right=0.985, top=0.92, bottom=0.14, hspace=0.55)
    stance, hold, interval = (figure.add_subplot(cell) for cell in (grid[:, 0], grid[0, 1], grid[1, 1]))
    stance.set(xlim=(-0.5, 0.72), ylim=(-0.16, 2.02), aspect="equal")
    stance.axis("off")
    stance.plot([-0.5, 0.5], [-0.045, -0.045], color=INK, lw=1)
    stance.text(0, -0.06, f"sway × {LARGER:.0f}", ha="center", va="top", color=INK, fontsize=8)
    bodies = []
    for colour, order in ((GHOST, 1), (BODY, 2)):
        stance.plot(FOOT, (-0.02, -0.02), color=colour, lw=6, solid_capstyle="round", zorder=order)
        (line,) = stance.plot([], [], color=colour, lw=11, solid_capstyle="round", zorder=order)
        (head,) = stance.plot([], [], "o", color=colour, ms=20, zorder=order)
        bodies.append(Figures(line, head))
    believed, real = bodies
    stance.plot([], [], color=BODY, lw=5, label="body")
    stance.plot([], [], color=GHOST, lw=5, label="hold's prediction")
    stance.legend(loc="upper left", frameon=False, fontsize=8, borderaxespad=0, handlelength=1)
    for axes in (hold, interval):
        axes.set_xlim(0, SECONDS)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8, colors=INK)
    hold.set(ylim=(0, 1.35 * threshold))
    hold.set_title("hold error (°): at the threshold, an event", fontsize=9, loc="left", color=INK)
    hold.axhline(threshold, color=EVENT, lw=1, ls="--")
    (saw,) = hold.plot([], [], color=BODY, lw=1)
    interval.set(ylim=(0, 1.25 * delta_crit))
    interval.set_xlabel("time (s)", fontsize=8, color=INK)
    interval.set_title("time between events (s)", fontsize=9, loc="left", color=INK)
    interval.axhline(delta_crit, color=EVENT, lw=1, ls="--")
    interval.text(0.1, delta_crit, f"predicted: {delta_crit:.4f}", va="bottom", color=EVENT, fontsize=8)
    (dots,) = interval.plot([], [], "o", color=BODY, ms=4)
    said = interval.text(SECONDS, 0.1, "", ha="right", va="bottom", color=BODY, fontsize=8)

    def show(frame: int) -> None:
        t = (frame + 1) / FRAMES_PER_SECOND
        row = min(np.searchsorted(run.t, t), len(run.t) - 1)
        real.pose(run.x[row, :3])
        believed.pose(run.x_h[row, :3])
        saw.set_data(run.t[: row + 1], error[: row + 1])
        until = run.events.t <= t
        dots.set_data(run.events.t[until], run.events.interval[until])
        last = run.events.interval[until][-1:]
        said.set_text(f"in MuJoCo: {last[0]:.4f}" if len(last) else "")

    frames = round(SECONDS * FRAMES_PER_SECOND)
    if still:
        show(frames - 1)
        figure.savefig(to, dpi=100, metadata={"Software": None})
        plt.close(figure)
        return
    pictures = []
    for frame in range(frames):
        show(frame)
        figure.canvas.draw()
        pictures.append(Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[:, :, :3].copy()))
    plt.close(figure)
    # one palette for all, without dithering: of each frame only what has changed is stored
    palette = pictures[-1].quantize(COLOURS, Image.Quantize.FASTOCTREE)
    palette.putpalette([255 if value > 250 else value for value in palette.getpalette()])
    first, *others = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    pause = [1000 // FRAMES_PER_SECOND] * (frames - 1) + [round(1000 * REST)]
    first.save(to, save_all=True, append_images=others, duration=pause, loop=0, optimize=True)
