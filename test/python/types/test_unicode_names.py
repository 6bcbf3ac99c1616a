"""Structs, fields, functions and variables may have names of any letters."""

import numpy as np
import pytest

import warp as wp
from warp.extend import errors


@wp.struct
class Größe:
    ü: int
    名前: wp.vec3
    plain: float


@wp.struct
class Außen:
    größe: Größe
    feld: wp.array(dtype=float)


@wp.func
def länge(g: Größe) -> float:
    g.名前.y += 1.0
    return g.名前.y * g.plain


@wp.kernel
def kërn(s: Außen, a: wp.array(dtype=Größe), out: wp.array(dtype=float)):
    ö = s.größe
    ö.ü += 1
    out[0] = float(ö.ü)
    out[1] = länge(ö) * s.feld[0]
    neu = Größe(ü=7)
    out[2] = float(neu.ü + a[0].ü)
    a[0].ü = 9
    a[0].名前[2] = 3.5
    a[0].名前.x += 1.0
    b = type(ö)()
    b.plain = 4.0
    for i in range(3):
        b.名前[i] = b.plain
    out[3] = wp.length_sq(b.名前)


def given(device):
    s = Außen()
    s.größe = Größe(ü=5, 名前=wp.vec3(1.0, 2.0, 3.0), plain=2.0)
    s.feld = wp.array([10.0], dtype=float, device=device, requires_grad=True)
    return s


def test_kernels(device):
    s = given(device)
    a = wp.array([Größe(ü=3)], dtype=Größe, device=device)
    out = wp.zeros(4, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(kërn, 1, [s, a], [out], device=device)
    assert out.numpy().tolist() == [6.0, 60.0, 10.0, 48.0]
    found = a.numpy()[0]
    assert found["ü"] == 9 and found["名前"].tolist() == [1.0, 0.0, 3.5]
    tape.backward(grads={out: wp.ones(4, dtype=float, device=device)})
    assert s.feld.grad.numpy()[0] == 6.0


def test_python():
    s = given("cpu")
    assert s.größe.ü == 5 and "名前=vec3f" in repr(s)
    assert Größe.numpy_dtype()["names"] == ["ü", "名前", "plain"]
    records = np.zeros(2, Größe.numpy_dtype())
    records["ü"] = 4, 5
    assert [one.ü for one in wp.array(records, dtype=Größe, device="cpu").list()] == [4, 5]
    with pytest.raises(errors.WarpError, match="field 'ü' of struct 'Größe' expects 'int32'"):
        s.größe.ü = 1.5


def test_messages():
    @wp.kernel
    def kernel(s: Größe):
        s.ß = 1

    with pytest.raises(errors.WarpError, match="struct 'Größe' has no field 'ß', it has: ü, 名前"):
        wp.launch(kernel, 1, [Größe()], device="cpu")
    arrays = [wp.zeros(1, dtype=kind, device="cpu") for kind in (Größe, float)]
    with pytest.raises(errors.WarpError, match="'s' expects 'Außen', but got 'Größe'"):
        wp.launch(kërn, 1, [Größe(), *arrays], device="cpu")


def test_code_for_gpus():
    assert ".entry" in kërn.ir("ptx", arch=90)
