"""`python -m warp.saved`: what saved modules and the kernel cache hold, for other tools."""

import shutil
import subprocess

import pytest

import warp as wp
from warp import saved


@wp.kernel
def scale(x: wp.array(dtype=float), a: float):
    i = wp.tid()
    x[i] = a * x[i]


def compiled(tmp_path, **options):
    (path,) = wp.compile_aot_module(__name__, module_dir=tmp_path, **options)
    return path


def extracted(path, tmp_path, kind):
    """The files that the command writes."""
    assert saved.main([str(path), "--extract", str(tmp_path / "out")]) == 0
    return sorted((tmp_path / "out" / path.stem).glob(f"*.{kind}"))


def test_objects_are_read_by_other_tools(tmp_path, capsys):
    files = extracted(compiled(tmp_path, device="cpu"), tmp_path, "o")
    listing = capsys.readouterr().out
    assert files and all(file.name in listing for file in files)
    assert "cpu" in listing and "packed arrays" in listing and "64-bit indices" in listing
    for file in files:
        # An ELF file for x86-64 that names the entry.
        assert int.from_bytes(file.read_bytes()[18:20], "little") == 62
        assert b"scale" in file.read_bytes()
    if reader := shutil.which("readelf"):
        shown = subprocess.run([reader, "-sW", files[0]], capture_output=True, text=True)
        assert shown.returncode == 0 and "FUNC" in shown.stdout and "scale" in shown.stdout


def test_ptx_is_assembled_by_other_tools(tmp_path):
    files = extracted(compiled(tmp_path, arch=90, use_ptx=True), tmp_path, "ptx")
    assert files
    for file in files:
        assert ".target sm_90" in file.read_text() and ".entry scale" in file.read_text()
    if assembler := shutil.which("ptxas"):
        made = subprocess.run([assembler, "-arch=sm_90", files[0], "-o", tmp_path / "made.cubin"])
        assert made.returncode == 0
        assert saved.kind_of((tmp_path / "made.cubin").read_bytes()) == "cubin"


def test_ptx_lies_beside_what_was_asked_for_as_ptx(tmp_path):
    path = compiled(tmp_path, arch=90, use_ptx=True)
    beside = sorted((path.parent / path.stem).glob("*.ptx"))
    assert [file.read_bytes() for file in beside] == [one["code"] for one in saved.read(path)]
    assert beside and not compiled(tmp_path, arch=80).with_suffix("").exists()


def test_files_of_the_cache(fresh_cache):
    @wp.kernel(module="unique")
    def cached(x: wp.array(dtype=float)):
        x[wp.tid()] = 3.0

    wp.launch(cached, 4, [wp.zeros(4, dtype=float, device="cpu")], device="cpu")
    (file,) = fresh_cache.rglob("*.code")
    (one,) = saved.read(file)
    assert one["kind"] == "o" and "cached" in one["kernel"]


@pytest.mark.parametrize("content", [b"", b"WARPCODE", b"WARPSAVE" + bytes(100), b"text"])
def test_other_files_are_refused(tmp_path, capsys, content):
    path = tmp_path / "other.warp"
    path.write_bytes(content)
    assert saved.main([str(path), str(tmp_path / "absent.warp")]) == 1
    shown = capsys.readouterr().err
    assert "other.warp" in shown and "absent.warp" in shown
