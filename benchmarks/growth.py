"""How learning grows with runs and with options: seconds of the processor, memory, the exponents, and a picture.

    python -m benchmarks.growth [--runs 500,2000,5000,20000] [--options 40,200,622,1000] [--resamples 50]
                                [--picture docs/growth.svg]

Each point is a whole training in a process of its own: of so many runs with 40 options, and of 2,000 runs with so many
options, 12 metrics and 3 objectives. The exponent is the slope of the straight line through the logarithms: 1 where
twice the size takes twice as long.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

MOST_MB = 2048
OPTIONS, RUNS = 40, 2000
CHILD = """
import resource, sys, time
import numpy as np
from care_core.learn.train import TrainSettings, train
from tests.simulated import simulate
runs, options, resamples = map(int, sys.argv[1:])
acting = min(options, 40)
table, schema = simulate(runs, np.random.default_rng(0), options=acting, inert=options - acting, metrics=12,
                         objectives=3)[:2]
began = time.process_time()
train(table, schema, TrainSettings(n_jobs=1, resamples=resamples), lambda step, share: None)
print(time.process_time() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


class Point(NamedTuple):
    """One training: its size, seconds of the processor, and the peak of its memory in MB."""

    size: int
    cpu_s: float
    peak_mb: float


def trained(runs: int, options: int, resamples: int, size: int) -> Point:
    """What one training costs."""
    words = (sys.executable, "-c", CHILD, str(runs), str(options), str(resamples))
    printed = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True).stdout
    seconds, peak_mb = map(float, printed.split()[-2:])
    return Point(size, seconds, peak_mb)


def exponent(points: Sequence[Point]) -> float:
    """The slope of the logarithm of seconds over that of the size; not a number for fewer than two points."""
    if len(points) < 2:
        return math.nan
    sizes, seconds = (np.log([point[i] for point in points]) for i in (0, 1))
    return float(np.polyfit(sizes, seconds, 1)[0])


def report(what: str, points: Sequence[Point]) -> None:
    """A table of one curve."""
    print(f"{what}: seconds grow as its {exponent(points):.2f}th power")
    for point in points:
        kept = "kept  " if point.peak_mb <= MOST_MB else "MISSED"
        print(f"  {point.size:6d}  {point.cpu_s:8.1f} s  {kept} {point.peak_mb:6.0f} MB, at most {MOST_MB}", flush=True)


WIDTH, HEIGHT, LEFT, TOP, PLOT_WIDTH, PLOT_HEIGHT = 760, 330, 60, 40, 290, 230
COLOUR, GRID, TEXT = "#1f6f8b", "#c8c8c8", "#404040"


def picture(curves: Sequence[tuple[str, Sequence[Point]]]) -> str:
    """The curves side by side on logarithmic axes, as SVG."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif"'
        f' font-size="12" fill="{TEXT}">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    for number, (what, points) in enumerate(curves):
        parts += _plot(what, points, LEFT + number * (PLOT_WIDTH + 80))
    return "\n".join([*parts, "</svg>\n"])


def _plot(what: str, points: Sequence[Point], left: int) -> list[str]:
    sizes, seconds = [point.size for point in points], [point.cpu_s for point in points]
    low, high = math.floor(math.log10(min(seconds))), math.ceil(math.log10(max(seconds)))
    high = max(high, low + 1)
    width = math.log10(max(sizes) / min(sizes)) or 1.0

    def x(size: float) -> float:
        return left + 15 + (PLOT_WIDTH - 30) * math.log10(size / min(sizes)) / width

    def y(value: float) -> float:
        return TOP + PLOT_HEIGHT * (1 - (math.log10(value) - low) / (high - low))

    title = f"{what}: power {exponent(points):.2f}"
    parts = [f'<text x="{left}" y="{TOP - 16}" font-size="14">{title}</text>']
    for power in range(low, high + 1):
        at = y(10.0**power)
        parts.append(f'<line x1="{left}" x2="{left + PLOT_WIDTH}" y1="{at:.1f}" y2="{at:.1f}" stroke="{GRID}"/>')
        parts.append(f'<text x="{left - 6}" y="{at + 4:.1f}" text-anchor="end">{10.0**power:g} s</text>')
    line = " ".join(f"{x(point.size):.1f},{y(point.cpu_s):.1f}" for point in points)
    parts.append(f'<polyline points="{line}" fill="none" stroke="{COLOUR}" stroke-width="2"/>')
    for number, point in enumerate(points):
        label = (20, -9)[number % 2]  # below and above in turn: neighbours would cover each other
        across, down = x(point.size), y(point.cpu_s)
        parts.append(f'<circle cx="{across:.1f}" cy="{down:.1f}" r="4" fill="{COLOUR}"/>')
        parts.append(
            f'<text x="{across:.1f}" y="{down + label:.1f}" text-anchor="middle">{point.cpu_s:.0f} s,'
            f" {point.peak_mb:.0f} MB</text>"
        )
        below = TOP + PLOT_HEIGHT + 18
        parts.append(f'<text x="{across:.1f}" y="{below}" text-anchor="middle">{point.size}</text>')
    return parts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", default="500,2000,5000,20000")
    parser.add_argument("--options", default="40,200,622,1000")
    parser.add_argument("--resamples", type=int, default=50)
    parser.add_argument("--picture", type=Path)
    args = parser.parse_args()
    runs = [trained(size, OPTIONS, args.resamples, size) for size in map(int, args.runs.split(","))]
    report(f"runs, with {OPTIONS} options", runs)
    options = [trained(RUNS, size, args.resamples, size) for size in map(int, args.options.split(","))]
    report(f"options, of {RUNS} runs", options)
    if args.picture is not None:
        from care_core.files import write_atomically

        curves = ((f"runs ({OPTIONS} options)", runs), (f"options ({RUNS} runs)", options))
        write_atomically(args.picture, picture(curves))


if __name__ == "__main__":
    main()
