"""The programs that show geometry run, and say that nothing got where it must not be."""

from pathlib import Path

import pytest

import programs

ROOT = Path(__file__).resolve().parents[3]


def cells(out):
    """The last row of the table that a program prints."""
    return [cell.strip() for cell in out.strip().splitlines()[-1].strip("|").split("|")]


@pytest.mark.parametrize(
    "name, options, check",
    [
        (
            "mesh_collision",
            ["--particles", "1000", "--steps", "400"],
            lambda row: int(row[2]) > 0 and row[3] == "0",
        ),
        ("grains", ["--grains", "1500", "--steps", "40"], lambda row: row[2] == "0"),
        (
            "rocks",
            ["--size", "40", "--particles", "500", "--steps", "150"],
            # A voxel has an edge of 0.05.
            lambda row: int(row[1]) > 0 and float(row[2]) < 0.01 and float(row[5]) < 0.02,
        ),
    ],
)
def test_examples_of_geometry_run(tmp_path, device, name, options, check):
    program = ROOT / "examples" / f"{name}.py"
    status, out, err = programs.run(program, "--device", device, "--output", tmp_path, *options)
    assert status == 0, err
    assert check(cells(out)), out
    picture = tmp_path / f"{name}_{device.replace(':', '')}.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
