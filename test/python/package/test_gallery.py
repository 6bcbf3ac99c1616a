"""The gallery shows every example, and its programs give what it says."""

import os
import re
from pathlib import Path

import pytest

import programs

ROOT = Path(__file__).resolve().parents[3]


def test_every_example_is_in_the_gallery():
    text = (ROOT / "docs" / "gallery.md").read_text()
    parts = {"particles_kernels", "particles_plots", "particles_precision", "integrate_kernels"}
    parts |= {"movies", "blocks", "saxpy_kernels"}
    names = {path.stem for path in (ROOT / "examples").rglob("*.py")} - parts
    assert names == set(re.findall(r"`examples/(?:\w+/)?(\w+)\.py`", text))
    for picture in re.findall(r"\]\((gallery/\w+\.png)\)", text):
        assert 1000 < (ROOT / "docs" / picture).stat().st_size <= 60_000
    films = re.findall(r"\]\((gallery/\w+\.webp)\)", text)
    assert len(films) == 8
    for film in films:
        assert 10_000 < (ROOT / "docs" / film).stat().st_size <= 1_000_000


@pytest.mark.parametrize(
    ("name", "options", "bounds"),
    [
        ("ocean", ("--size", "64", "--frames", "2"), {4: 1e-5, 5: 1e-5}),
        ("cloth", ("--size", "8", "--steps", "60"), {4: 1e-7, 5: 1e-3}),
        ("several_devices", ("--size", "129", "--steps", "50"), {6: 2e-5}),
        ("fem/twist", ("--cells", "2", "--turn", "0.25"), {5: 1e-7, 6: 1e-7}),
        ("fem/diffusion", ("--cells", "6", "--steps", "8"), {4: 3e-4, 6: 1e-12}),
        ("fem/transport", ("--cells", "6"), {4: 3e-4, 6: 1e-5}),
        ("fem/channel", ("--cells", "1"), {4: 0.01, 6: 0.05, 8: 0.06}),
        ("fem/elasticity", ("--cells", "2"), {4: 2e-3}),
        ("fem/adaptive", ("--cells", "8", "--levels", "1"), {4: 5e-3}),
        ("fem/shape", ("--rings", "4"), {5: 3e-3, 6: 1e-3, 7: 1e-6}),
        ("fem/fluid", ("--cells", "16", "--turns", "0.25"), {2: 1e-12, 4: 0.1}),
        ("fem/granular", ("--end", "3"), {3: 1e-5, 4: 5e-3, 7: 0.3}),
    ],
)
def test_examples_keep_their_errors(tmp_path, device, name, options, bounds):
    place = (
        ("--devices", f"{device},{device}") if name == "several_devices" else ("--device", device)
    )
    program = ROOT / "examples" / f"{name}.py"
    status, out, err = programs.run(program, *place, "--output", tmp_path, *options)
    assert status == 0, err
    row = [cell.strip() for cell in out.strip().splitlines()[-1].strip("|").split("|")]
    for column, bound in bounds.items():
        assert 0.0 <= float(row[column]) < bound, out
    assert name != "several_devices" or row[5] == "yes"
    assert next(tmp_path.glob(f"{Path(name).name}*.png")).read_bytes().startswith(b"\x89PNG")


SMALL = ("--frames", "2", "--samples", "1", "--width", "48", "--height", "28", "--scale", "0.03")


@pytest.mark.parametrize(
    ("name", "bound"),
    [
        ("ocean_sunset", 1e-5),
        ("cloth_drape", 1.0),
        ("drum", 1.0),
        # In voxels: a grid of samples has the surface within half of one.
        ("dusty_rocks", 0.5),
        ("dam_break", 1.0),
        ("thrown_ball", 1e-6),
        ("smoke", 1e-3),
        ("soft_bodies", 1e-7),
    ],
)
def test_scenes_keep_their_errors(tmp_path, device, name, bound):
    pytest.importorskip("PIL")
    program = ROOT / "examples" / "scenes" / f"{name}.py"
    status, out, err = programs.run(program, "--device", device, "--output", tmp_path, *SMALL)
    assert status == 0, err
    row = [cell.strip() for cell in out.strip().splitlines()[-1].strip("|").split("|")]
    assert 0.0 <= float(row[4]) < bound, out
    assert next(tmp_path.glob(f"{name}*.webp")).read_bytes().startswith(b"RIFF")


@pytest.mark.parametrize(
    ("name", "library"),
    [("torch_particles", "torch"), ("torch_autograd", "torch"), ("jax_wave", "jax")],
)
def test_examples_without_their_library_say_so(tmp_path, name, library):
    (tmp_path / f"{library}.py").write_text(f"raise ModuleNotFoundError('{library}')")

    paths = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    status, out, err = programs.run(ROOT / "examples" / f"{name}.py", PYTHONPATH=paths)
    assert status == 0 and out.startswith("skipped: this example needs"), err
