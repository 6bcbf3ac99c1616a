"""`.vdb` files written and read through the component of OpenVDB."""

import ctypes
import os
import pathlib
import shutil
import subprocess
import sys
import sysconfig

import numpy as np
import pytest

import warp as wp
from warp._src.geometry.volumes import vdb


def is_loadable():
    try:
        ctypes.CDLL(str(pathlib.Path(wp.__file__).parent / "libwarp_openvdb.so"))
    except OSError:
        return False
    return True


needs_component = pytest.mark.skipif(not is_loadable(), reason="OpenVDB is not installed")


@wp.kernel
def look(
    id: wp.uint64,
    ijk: wp.array(dtype=wp.vec3i),
    values: wp.array(dtype=float),
    places: wp.array(dtype=wp.vec3),
):
    n = wp.tid()
    v = ijk[n]
    values[n] = wp.volume_lookup_f(id, v[0], v[1], v[2])
    places[n] = wp.volume_index_to_world(id, wp.vec3(float(v[0]), float(v[1]), float(v[2])))


def found(volume, voxels):
    ijk = wp.array(voxels, dtype=wp.vec3i, device=volume.device)
    values = wp.zeros(len(voxels), dtype=float, device=volume.device)
    places = wp.zeros(len(voxels), dtype=wp.vec3, device=volume.device)
    wp.launch(look, len(voxels), [volume.id, ijk], [values, places], device=volume.device)
    return values.numpy(), places.numpy()


def make(device):
    values = np.random.default_rng(3).normal(size=(20, 24, 17)).astype(np.float32)
    return wp.Volume.load_from_numpy(
        values, min_world=(1.0, -2.0, 0.5), voxel_size=0.25, bg_value=-7.0, device=device
    )


@needs_component
def test_grids_come_back_with_values_and_place(tmp_path, device):
    volume = make(device)
    path = volume.save_to_vdb(tmp_path / "a.vdb", "smoke")
    again = wp.Volume.load_from_vdb(path, "smoke", device=device)
    assert again.device == volume.device and again.get_grid_info().name == "smoke"
    voxels = np.concatenate([volume.get_voxels().numpy(), [[500, 3, 2], [-40, 0, 0]]])
    for here, there in zip(found(volume, voxels), found(again, voxels), strict=True):
        np.testing.assert_array_equal(here, there)
    np.testing.assert_allclose(again.get_voxel_size(), 0.25, rtol=1e-7)
    first = wp.Volume.load_from_vdb(path, device=device)
    np.testing.assert_array_equal(found(first, voxels)[0], found(volume, voxels)[0])


@needs_component
def test_other_names_are_listed(tmp_path):
    make("cpu").save_to_vdb(tmp_path / "a.vdb", "smoke")
    with pytest.raises(RuntimeError, match=r"no grid 'fire', the file has 'smoke'"):
        wp.Volume.load_from_vdb(tmp_path / "a.vdb", "fire", device="cpu")


@needs_component
@pytest.mark.parametrize("keep", [0, 3, 200, 0.5, 0.9])
def test_damaged_files_are_refused(tmp_path, keep):
    make("cpu").save_to_vdb(tmp_path / "a.vdb")
    data = (tmp_path / "a.vdb").read_bytes()
    count = keep if isinstance(keep, int) else int(keep * len(data))
    (tmp_path / "b.vdb").write_bytes(data[:count])
    with pytest.raises(RuntimeError, match=r"b\.vdb"):
        wp.Volume.load_from_vdb(tmp_path / "b.vdb", device="cpu")


# Reads damaged copies of a file in a process of its own, so that an abort is seen as one.
READ_DAMAGED = """
import sys
import numpy as np
import warp as wp
folder, seeds = sys.argv[1], range(int(sys.argv[2]))
data = open(folder + "/a.vdb", "rb").read()
for seed in seeds:
    random, damaged = np.random.default_rng(seed), bytearray(data)
    for place in random.integers(len(data), size=3):
        damaged[place] = random.integers(256)
    open(folder + "/b.vdb", "wb").write(damaged)
    try:
        wp.Volume.load_from_vdb(folder + "/b.vdb", device="cpu")
    except RuntimeError as error:
        assert "b.vdb" in str(error)
print("alive")
"""


@needs_component
def test_changed_bytes_do_not_end_the_process(tmp_path):
    make("cpu").save_to_vdb(tmp_path / "a.vdb")
    command = [sys.executable, "-c", READ_DAMAGED, tmp_path, "24"]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.endswith("alive\n")


# A component whose reader is ended by a signal, as by a write beyond its memory.
ABORTING = """
#include <cstdlib>
extern "C" void *warp_vdb_read(...) { std::abort(); }
"""


def test_the_end_of_the_reader_is_an_error(tmp_path, monkeypatch):
    compiler = shutil.which("c++") or shutil.which("clang++-22")
    if not compiler:
        pytest.skip("no C++ compiler")
    library = tmp_path / "libaborting.so"
    command = [compiler, "-shared", "-fPIC", "-x", "c++", "-", "-o", library]
    subprocess.run(command, input=ABORTING, text=True, check=True)
    monkeypatch.setattr(vdb, "_component", lambda: [str(library)])
    (tmp_path / "a.vdb").write_bytes(b"x" * 100)
    with pytest.raises(RuntimeError, match=r"a\.vdb': .* ended by SIGABRT: the file is damaged"):
        wp.Volume.load_from_vdb(tmp_path / "a.vdb", device="cpu")


# `sys.executable` of a program that embeds Python is that program.
def test_embedded_interpreters_start_no_copy_of_their_program(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/opt/houdini/bin/hython-bin")
    found = pathlib.Path(vdb._interpreter())
    assert found.parent == pathlib.Path(sysconfig.get_path("scripts"))
    assert found.name.startswith("python")


def test_files_of_nanovdb_are_told_apart(tmp_path):
    make("cpu").save_to_nvdb(tmp_path / "a.nvdb")
    with pytest.raises(RuntimeError, match=r"a\.nvdb' is a file of NanoVDB: use 'load_from_nvdb'"):
        wp.Volume.load_from_vdb(tmp_path / "a.nvdb", device="cpu")


@needs_component
def test_absent_files_and_folders(tmp_path):
    with pytest.raises(FileNotFoundError):
        wp.Volume.load_from_vdb(tmp_path / "a.vdb", device="cpu")
    with pytest.raises(RuntimeError, match="none"):
        make("cpu").save_to_vdb(tmp_path / "none" / "a.vdb")


@pytest.mark.parametrize("is_there", [False, True])
def test_without_the_component_the_error_names_both_ways(tmp_path, monkeypatch, is_there):
    def absent(path):
        raise OSError("libopenvdb.so.10: cannot open shared object file")

    monkeypatch.setattr(ctypes, "CDLL", absent)
    monkeypatch.setattr(pathlib.Path, "exists", lambda path: is_there)
    vdb._component.cache_clear()
    (tmp_path / "a.vdb").write_bytes(b"")
    try:
        problem = r"libopenvdb\.so\.10" if is_there else "not in this package"
        with pytest.raises(ImportError, match=rf"{problem}.*libopenvdb-dev.*nanovdb_convert"):
            wp.Volume.load_from_vdb(tmp_path / "a.vdb", device="cpu")
    finally:
        vdb._component.cache_clear()


# In a process in which the package has no component of its own.
OF_A_WHEEL = """
import pathlib, sys, types
import numpy as np
import warp as wp
from warp._src.geometry.volumes import vdb
vdb._native = types.SimpleNamespace(__file__="/nowhere/_native.so")
values = np.arange(64, dtype=np.float32).reshape(4, 4, 4)
made = wp.Volume.load_from_numpy(values, voxel_size=0.5, device="cpu")
made.save_to_vdb(sys.argv[1])
again = wp.Volume.load_from_vdb(sys.argv[1], device="cpu")
assert again.get_voxel_count() == made.get_voxel_count()
maps = pathlib.Path("/proc/self/maps").read_text()
loaded = {line.split()[-1] for line in maps.splitlines() if "libopenvdb" in line}
assert len(loaded) == 1 and "warp_mlir_vdb" in loaded.pop(), loaded
print("read", again.get_voxel_count())
"""


@needs_component
def test_the_wheel_of_the_component_needs_no_library_of_the_system(tmp_path):
    root = pathlib.Path(__file__).resolve().parents[3]
    own = pathlib.Path(wp.__file__).parent / "libwarp_openvdb.so"
    make = [sys.executable, root / "scripts" / "make_vdb.py", tmp_path / "dist"]
    subprocess.run([*make, "--library", own, "--level", "0"], check=True, capture_output=True)
    (wheel,) = (tmp_path / "dist").iterdir()
    site = tmp_path / "site"
    install = [sys.executable, "-m", "pip", "install", "-q", "--no-index", "--target", site, wheel]
    subprocess.run(install, check=True, capture_output=True)
    licences = {path.name for path in site.glob("*.dist-info/licenses/*")}
    assert "LICENSE" in licences and any("openvdb" in name for name in licences)
    paths = [str(pathlib.Path(wp.__file__).parents[1]), str(site)]
    run = subprocess.run(
        [sys.executable, "-c", OF_A_WHEEL, tmp_path / "a.vdb"],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("read ")
