"""`@wp.kernel` and `@wp.func` as Python objects: options, IR as text, dumps, calls."""

import re
import threading
import typing
from concurrent.futures import ThreadPoolExecutor
from time import sleep
from typing import Any

import pytest

import warp as wp


@wp.kernel
def twice(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = 2.0 * x[i]


@wp.func
def shift(x: float, by: float = 1.0):
    return x + by


@wp.func
def kind(x: float):
    return "float"


@wp.func
def kind(x: int):  # noqa: F811
    return "int"


@wp.func
def kind(x: wp.vec3):  # noqa: F811
    return "vec3"


@pytest.mark.parametrize(
    "stage, text",
    [
        ("warp", "!warp.array<1 x f32>"),
        ("thread", "warp.load_components"),
        ("launch", "warp.threads"),
        ("gpu", "gpu.func"),
        ("llvm", "define "),
        ("ptx", ".visible .entry"),
        ("asm", "ret"),
    ],
)
def test_every_stage_can_be_seen(stage, text):
    assert text in twice.ir(stage=stage)


@wp.kernel
def place(x: wp.array2d(dtype=int)):
    i, j = wp.tid()
    x[i, j] = 1000 * i + j


def test_the_code_shown_is_for_as_many_dimensions_as_the_kernel_has():
    whole = place.ir("ptx")
    assert whole == place.ir("ptx", rank=2)
    # Without the second, which is then zero, nothing is added to the product.
    assert len(place.ir("ptx", rank=1)) < len(whole)
    assert twice.ir("ptx") == twice.ir("ptx", rank=1)


def test_unknown_stage():
    with pytest.raises(ValueError, match="'launch', 'gpu', 'llvm', 'ptx', 'asm'"):
        twice.ir(stage="mlir")


def test_dump(config, tmp_path, device):
    config.dump = str(tmp_path / "dump")
    wp.launch(twice, 1, [wp.zeros(1, device=device)], device=device)
    assert sorted(path.name for path in (tmp_path / "dump").iterdir()) == [
        "twice.asm.s",
        "twice.gpu.mlir",
        "twice.launch.mlir",
        "twice.llvm.ll",
        "twice.ptx.ptx",
        "twice.thread.mlir",
        "twice.warp.mlir",
    ]


def test_settings_that_change_code_apply_to_known_kernels(config, device):
    x = wp.ones(4, device=device)
    wp.launch(twice, 4, [x], device=device)
    config.mode = "debug"
    with pytest.raises(wp.WarpLaunchError, match="twice"):
        wp.launch(twice, 5, [x], device=device)
        wp.synchronize_device(device)
    config.mode = "release"
    wp.launch(twice, 4, [x], device=device)
    assert x.numpy()[0] == 8.0 or x.numpy()[0] == 4.0


def test_functions_stay_callable():
    assert shift(1.0) == 2.0 and shift(1.0, by=3.0) == 4.0
    assert (kind(1.0), kind(1), kind(wp.vec3())) == ("float", "int", "vec3")
    with pytest.raises(TypeError, match="no overload of 'kind'"):
        kind("a")
    assert shift.__name__ == shift.key == "shift"


def test_redefinition_replaces():
    @wp.func
    def f(x: float):
        return 1

    @wp.func
    def f(x: float):  # noqa: F811
        return 2

    assert len(f.overloads) == 1 and f(0.0) == 2


def test_kernel_options():
    @wp.kernel(enable_backward=False, name="named", module_options={"fast_math": True})
    def k(x: wp.array(dtype=float)):
        x[0] = 1.0

    assert k.key == "named" and k.option("fast_math") is True
    assert k.option("enable_backward") is False and k.option("mode") == wp.config.mode
    with pytest.raises(TypeError, match="no option 'speed'"):
        wp.kernel(speed=1)
    with pytest.raises(ValueError):
        wp.kernel(module_options={"speed": 1})
    for what in (3, len, wp.vec3):
        with pytest.raises(TypeError):
            wp.kernel(what)
        with pytest.raises(TypeError):
            wp.func(what)


def test_modules_know_their_kernels():
    module = wp.get_module(__name__)
    assert module.kernels["twice"] is twice
    wp.load_module(__name__)
    assert twice.native is not None
    module.mark_modified()
    assert twice.native is None


def test_loading_what_holds_nothing_of_warp_is_an_error():
    import collections

    for module, name in ((collections, "collections"), ("no_such_module", "no_such_module")):
        with pytest.raises(RuntimeError, match=f"'{name}' does not contain any Warp kernels"):
            wp.load_module(module)
    wp.load_module(wp.utils, device="cpu")


def test_captured_constants_after_mark_modified(device):
    out = wp.zeros(1, dtype=int, device=device)
    wp.launch(write_constant, 1, [out], device=device)
    assert out.numpy()[0] == 3
    globals()["CONSTANT"] = 4
    wp.get_module(__name__).mark_modified()
    wp.launch(write_constant, 1, [out], device=device)
    assert out.numpy()[0] == 4


CONSTANT = 3


@wp.kernel
def write_constant(out: wp.array(dtype=int)):
    out[0] = CONSTANT


def test_generic_kernels(device):
    @wp.kernel
    def double(x: wp.array(dtype=typing.Any), s: typing.Any):
        i = wp.tid()
        x[i] = x[i] * s

    assert double.is_generic
    for dtype, scale in ((float, 2.0), (wp.float64, wp.float64(2.0)), (wp.vec3, 2.0), (int, 2)):
        x = wp.ones(3, dtype=dtype, device=device)
        for expected in (2, 4):
            wp.launch(double, 3, [x, scale], device=device)
            assert (x.numpy() == expected).all()
    assert len(double.specializations) == 4
    with pytest.raises(wp.WarpError):
        wp.launch(double, 3, [None, 2.0], device=device)


def test_verbose_reports_times(config, device, capsys):
    config.verbose = True
    twice.reset()
    wp.launch(twice, 1, [wp.zeros(1, device=device)], device=device)
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.startswith("kernel 'twice': ")
    # All time of the launch has a name; parts of a phase are named "phase/part".
    words = captured.err.removeprefix("kernel 'twice': ").removesuffix(" ms\n").split(", ")
    times = {name: float(value) for name, value in (word.rsplit(" ", 1) for word in words)}
    whole = times.pop("in all")
    phases = [value for name, value in times.items() if "/" not in name]
    assert {"translate", "other"} <= times.keys()
    assert abs(sum(phases) - whole) <= 0.1 * (len(phases) + 1)
    wp.launch(twice, 1, [wp.zeros(1, device=device)], device=device)
    assert capsys.readouterr().err == ""


def test_settings_that_return_find_what_was_made(monkeypatch):
    @wp.kernel
    def count(a: wp.array(dtype=float)):
        a[wp.tid()] += 1.0

    @wp.kernel
    def count_any(a: wp.array(dtype=Any)):
        a[wp.tid()] += a.dtype(1)

    a = wp.zeros(3, dtype=float, device="cpu")
    seen = []
    for mode in ("release", "debug", "release", "debug"):
        monkeypatch.setattr(wp.config, "mode", mode)
        for kernel in (count, count_any):
            wp.launch(kernel, 3, [a], device="cpu")
        seen.append((count.native, *count_any.specializations))
    assert list(a.numpy()) == [8.0] * 3
    assert seen[0] == seen[2] and seen[1] == seen[3] and seen[0] != seen[1]


@wp.func
def halved(v: wp.vec3, by: float):
    return wp.normalize(v) / by


@pytest.mark.parametrize("given", [(1.0,), (1.0, 2.0), ()])
def test_functions_called_from_python_say_what_they_were_given(given):
    """A TypeError and a RuntimeError, in words that programs look for."""
    words = f"Error calling function 'halved', no overload found for arguments {given}"
    for kind in (TypeError, RuntimeError):
        with pytest.raises(kind, match=f"^{re.escape(words)}$"):
            halved(*given)


def test_threads_share_one_translation(monkeypatch):
    """Whoever comes first translates; a second native kernel would be compiled once more."""
    translate = wp.Kernel._translate

    def translate_slowly(*arguments):
        sleep(0.02)
        return translate(*arguments)

    monkeypatch.setattr(wp.Kernel, "_translate", translate_slowly)

    @wp.kernel
    def halve(x: wp.array(dtype=float)):
        i = wp.tid()
        x[i] = 0.5 * x[i]

    @wp.kernel
    def halve_any(x: wp.array(dtype=Any)):
        i = wp.tid()
        x[i] = x.dtype(0.5) * x[i]

    @wp.kernel
    def total(x: wp.array(dtype=float), out: wp.array(dtype=float)):
        wp.tile_store(out, wp.tile_sum(wp.tile_load(x, shape=64)))

    workers = 8
    start = threading.Barrier(workers)
    x = wp.ones(4, dtype=float, device="cpu")
    total.prepare()

    def prepare():
        start.wait()
        return (
            halve.prepare(),
            halve_any.specialize((x,)),
            total.hook("blocks").for_blocks(total, None, 64),
        )

    with ThreadPoolExecutor(workers) as pool:
        found = [one.result() for one in [pool.submit(prepare) for _ in range(workers)]]
    for made in zip(*found, strict=True):
        assert len({id(one) for one in made}) == 1
