"""Shared parts of the scenes: options, frames of a film, and the table that each prints."""

import argparse
import time
from pathlib import Path

import numpy as np

import warp as wp
from warp.render import Scene, save_movie, save_picture

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"


class Movie:
    """Options of a scene's program, its `Scene`, and the frames drawn so far."""

    def __init__(self, name, text, frames=24, samples=8, fps=24.0, still=None):
        parser = argparse.ArgumentParser(description=text.splitlines()[0])
        parser.add_argument("--device", default=None)
        parser.add_argument("--width", type=int, default=1280)
        parser.add_argument("--height", type=int, default=720)
        parser.add_argument("--frames", type=int, default=frames)
        parser.add_argument("--samples", type=int, default=samples)
        parser.add_argument("--scale", type=float, default=1.0, help="of the number of parts")
        parser.add_argument("--output", type=Path, default=OUTPUT)
        parser.add_argument("--html", action="store_true", help="write a page for a browser too")
        self.options = parser.parse_args()
        wp.config.quiet = True
        self.name, self.fps, self.pictures = name, fps, []
        self.still = still
        self.frames, self.device = self.options.frames, wp.get_device(self.options.device)
        options = self.options
        self.scene = Scene(options.width, options.height, device=self.device)
        self.scene.limit = 4.0
        self.work, self.drawing = 0.0, 0.0

    def count(self, number):
        """A number of parts, scaled as asked."""
        return max(8, int(number * self.options.scale))

    def timed(self, work):
        """Runs simulation work, whose time counts as such."""
        start = time.perf_counter()
        result = work()
        wp.synchronize_device(self.device)
        self.work += time.perf_counter() - start
        return result

    def add(self):
        """Draws a frame."""
        start = time.perf_counter()
        last = len(self.pictures) + 1 == self.frames
        samples = self.options.samples * (4 if last and self.frames > 1 else 1)
        self.pictures.append(self.scene.render(samples))
        if self.options.html:
            self.scene.keep_frame()
        self.drawing += time.perf_counter() - start

    def finish(self, rate, unit, error, of):
        """Writes the files and prints the table."""
        options = self.options
        options.output.mkdir(parents=True, exist_ok=True)
        name = f"{self.name}_{self.device.alias.replace(':', '')}"
        picture = self.pictures[-1 if self.still is None else min(self.still, self.frames - 1)]
        save_picture(options.output / f"{name}.png", picture)
        if self.frames > 1:
            save_movie(options.output / f"{name}.webp", self.pictures, self.fps, quality=60)
        if options.html:
            self.scene.save_html(options.output / f"{name}.html", self.name, self.fps)
        paths = self.frames * options.samples * options.width * options.height / 1e6
        print(f"| device | frames | {unit} | M paths a second | {of} |")
        print("| --- | ---: | ---: | ---: | ---: |")
        drawn = paths / max(self.drawing, 1e-9)
        print(f"| {self.device} | {self.frames} | {rate:.3g} | {drawn:.2f} | {error:.1e} |")


def revolved(profile, sides=48):
    """Points and faces of a profile of (radius, height) turned about y."""
    profile = np.asarray(profile, float)
    turn = np.arange(sides) * (2.0 * np.pi / sides)
    x, z = np.outer(profile[:, 0], np.cos(turn)), np.outer(profile[:, 0], np.sin(turn))
    y = np.repeat(profile[:, 1:], sides, axis=1)
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    a = (np.arange(len(profile) - 1)[:, None] * sides + np.arange(sides)).reshape(-1)
    b = (np.arange(len(profile) - 1)[:, None] * sides + np.roll(np.arange(sides), -1)).reshape(-1)
    faces = np.stack([a, a + sides, b + sides, a, b + sides, b], axis=1)
    return points.astype(np.float32), faces.reshape(-1).astype(np.int32)
