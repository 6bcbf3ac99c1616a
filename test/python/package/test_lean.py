"""An unused feature costs no code, memory, launch or import; `wp.manifest` says so."""

import re
import subprocess
import sys
import time

import pytest

import warp as wp
from warp.report.__main__ import main


@wp.struct
class Settings:
    gain: float
    damping: float


@wp.kernel
def scale(x: wp.array(dtype=float), y: wp.array(dtype=float), w: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = wp.sin(x[i]) * w[i]


@wp.kernel
def scale_by_settings(x: wp.array(dtype=float), s: Settings, count: int):
    i = wp.tid()
    x[i] = x[i] * s.gain


def entries(name):
    return [one for one in wp.manifest(code=True, module=__name__) if one.kernel == name]


def instructions(text):  # without the names and the order of parameters
    return [line for line in text.splitlines() if line.startswith("\t") and "param" not in line]


def test_manifest_names_what_is_unused():
    scale_by_settings.ir()
    (entry,) = entries("scale_by_settings")
    assert entry.variant == "forward" and entry.instructions > 0 and entry.library == ()
    assert entry.operations["warp.struct_get"] == 1
    assert set(entry.unused) == {
        "parameter 'count' is never used",
        "field 'damping' of struct 'Settings' is never used",
    }
    assert "kernel 'scale_by_settings': parameter 'count' is never used" in str(wp.manifest())
    assert wp.manifest(module=sys.modules[__name__]) == wp.manifest(module=__name__) != ()
    assert wp.manifest(module="no.such.module") == ()


# C1: a forward launch of arrays with gradients makes no derivative and no other code.
def test_derivatives_are_made_by_the_first_backward():
    before = scale.ir("asm")
    x, y = (wp.ones(8, dtype=float, device="cpu", requires_grad=True) for _ in range(2))
    w = wp.ones(8, dtype=float, device="cpu")
    wp.launch(scale, 8, [x, y, w], device="cpu")
    assert [one.variant for one in entries("scale")] == ["forward"]
    assert scale.ir("asm") == before
    with wp.Tape() as tape:
        wp.launch(scale, 8, [x, y, w], device="cpu")
    tape.backward(grads={y: wp.ones(8, dtype=float, device="cpu")})
    assert [one.variant for one in entries("scale")] == ["forward", "adjoint"]


# C2: the adjoint for one input has what one would write by hand.
def test_adjoint_of_chosen_inputs():
    @wp.kernel
    def by_hand(
        x: wp.array(dtype=float),
        w: wp.array(dtype=float),
        dx: wp.array(dtype=float),
        dy: wp.array(dtype=float),
    ):
        i = wp.tid()
        g = dy[i]
        dy[i] = 0.0
        dx[i] = dx[i] + g * w[i] * wp.cos(x[i])

    one = instructions(scale.ir("ptx", derivative="adjoint", inputs=["x", "y"]))
    both = instructions(scale.ir("ptx", derivative="adjoint"))
    written = instructions(by_hand.ir("ptx"))
    assert len(one) < len(both) and len(one) <= 1.2 * len(written)
    assert "%2 = warp.grad" in scale.ir("adjoint", inputs=["x", "y"])
    with pytest.raises(ValueError, match="no array 'z' in 'scale'; there are 'x', 'y', 'w'"):
        scale.ir("ptx", derivative="adjoint", inputs=["z"])
    with pytest.raises(ValueError, match="no derivative 'hessian'"):
        scale.ir("ptx", derivative="hessian")


@pytest.mark.parametrize("stage", ["warp", "thread", "launch", "gpu", "llvm", "asm", "ptx"])
def test_adjoint_of_chosen_inputs_at_every_stage(stage):
    one = scale.ir(stage, derivative="adjoint", inputs=["x", "y"])
    assert "scale_adjoint" in one
    assert len(one) < len(scale.ir(stage, derivative="adjoint"))


def test_adjoint_for_rest_lengths_of_springs():
    @wp.kernel
    def energies(
        x: wp.array(dtype=wp.vec3),
        ends: wp.array(dtype=wp.vec2i),
        rest: wp.array(dtype=float),
        stiffness: float,
        energy: wp.array(dtype=float),
    ):
        i = wp.tid()
        stretch = wp.length(x[ends[i][1]] - x[ends[i][0]]) - rest[i]
        energy[i] = 0.5 * stiffness * stretch * stretch

    @wp.kernel
    def by_hand(
        x: wp.array(dtype=wp.vec3),
        ends: wp.array(dtype=wp.vec2i),
        rest: wp.array(dtype=float),
        stiffness: float,
        d_rest: wp.array(dtype=float),
        d_energy: wp.array(dtype=float),
    ):
        i = wp.tid()
        stretch = wp.length(x[ends[i][1]] - x[ends[i][0]]) - rest[i]
        g = d_energy[i]
        d_energy[i] = 0.0
        d_rest[i] = d_rest[i] - g * stiffness * stretch

    one = instructions(energies.ir("ptx", derivative="adjoint", inputs=["rest", "energy"]))
    assert len(one) <= 1.2 * len(instructions(by_hand.ir("ptx")))


# C6: parameters without use change nothing but where the others lie.
def test_unused_parameters_cost_no_instruction():
    @wp.kernel
    def plain(x: wp.array(dtype=float)):
        x[wp.tid()] = x[wp.tid()] * 2.0

    @wp.kernel
    def more(x: wp.array(dtype=float), w: wp.array(dtype=float), contact: bool, s: Settings):
        gap = s.damping * 0.0
        x[wp.tid()] = x[wp.tid()] * 2.0

    assert instructions(more.ir("ptx")) == instructions(plain.ir("ptx"))


# C7 and C12: no part of the geometry library, no check and no print in code without them.
def test_code_holds_no_symbol_of_another_feature():
    for stage in ("asm", "ptx"):
        text = scale.ir(stage)
        assert not re.search(r"mesh|bvh|hash_grid|vprintf|printf|trap", text), stage


# C9: an empty launch runs nothing and compiles nothing, is no dearer than one thread, and takes at
# most 5 % of a step of a small scene.
def test_empty_launches():
    @wp.kernel
    def never(x: wp.array(dtype=float)):
        x[0] = 1.0

    @wp.kernel
    def fall(x: wp.array(dtype=wp.vec3), v: wp.array(dtype=wp.vec3), dt: float):
        i = wp.tid()
        v[i] -= wp.vec3(0.0, 9.81 * dt, 0.0)
        x[i] += v[i] * dt

    x = wp.zeros(1, dtype=float, device="cpu")
    wp.launch(never, 0, [x], device="cpu")
    assert x.numpy()[0] == 0.0
    assert not any(one.milliseconds for one in entries("never"))
    wp.launch(never, 1, [x], device="cpu")

    def seconds(kernel, dim, *inputs):
        wp.launch(kernel, dim, inputs, device="cpu")
        begin = time.perf_counter()
        for _ in range(200):
            wp.launch(kernel, dim, inputs, device="cpu")
        return time.perf_counter() - begin

    empty, one = (min(seconds(never, dim, x) for _ in range(7)) for dim in (0, 1))
    assert empty <= 1.5 * one
    state = [wp.zeros(40_000, dtype=wp.vec3, device="cpu") for _ in range(2)]
    assert empty <= 0.05 * min(seconds(fall, 40_000, *state, 0.01) for _ in range(7))


# C10: a program for the CPU loads no driver and none of the libraries around kernels.
def test_start_up_of_a_program_on_the_cpu():
    code = "import sys, warp as wp; wp.zeros(4, device='cpu').numpy();"
    code += "print(open('/proc/self/maps').read().count('libcuda'), *sys.modules)"
    made = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = made.stdout.split()
    assert loaded[0] == "0"
    parts = ("sparse", "optim", "report", "autograd", "utils.", "kernels.manifest")
    assert not [m for m in loaded if m.startswith(tuple(f"warp._src.{part}" for part in parts))]
    assert not {"torch", "jax", "matplotlib", "warp.report"} & set(loaded)


def test_lean_command(tmp_path, capsys):
    assert main(["lean", "bounce", "--output", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert "make_bounce_bounce (adjoint)" in text and "unused: nothing" in text
    assert (tmp_path / "lean.jsonl").stat().st_size > 300
    assert main(["lean", "no_such_scene"]) == 2
