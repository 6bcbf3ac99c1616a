"""The programs that show tiles run, and are as exact as their tables say."""

from pathlib import Path

import pytest

import programs

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize(
    "name, options, check",
    [
        (
            "image_network",
            ["--side", "32", "--steps", "60"],
            lambda row: row[0] < 1e-5 and row[2] < 0.1 * row[1],
        ),
        (
            "pendulum_chains",
            ["--chains", "16", "--links", "8", "--steps", "48"],
            lambda row: row[0] < 1e-4 and row[1] < 1e-4,
        ),
        (
            "galaxies",
            ["--bodies", "512", "--steps", "6"],
            lambda row: row[0] < 1e-4 and row[1] < 1e-6,
        ),
        (
            "spectrum_filter",
            ["--signals", "64"],
            lambda row: row[0] < 1e-5 and row[2] < 0.5 * row[1],
        ),
    ],
)
def test_examples_of_tiles_run(tmp_path, device, name, options, check):
    program = ROOT / "examples" / "tiles" / f"{name}.py"
    status, out, err = programs.run(program, "--device", device, "--output", tmp_path, *options)
    assert status == 0, err
    row = [float(cell) for cell in out.strip().splitlines()[-1].strip("|").split("|")]
    assert check(row), out
    picture = tmp_path / f"{name}_{device.replace(':', '')}.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
