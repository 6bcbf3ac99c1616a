"""Malformed IR given to warp-opt and to the library: a located error, never a crash."""

import random
import subprocess
from pathlib import Path

import pytest

import programs
import warp as wp
from warp import _native
from warp.extend import errors

ROOT = Path(__file__).resolve().parents[3]
WARP_OPT = ROOT / "build" / "bin" / "warp-opt"

MALFORMED = {
    "empty function name": "func.func @() { return }",
    "garbage": "\x00\x01 not ir }}}",
    "unknown operation": "func.func @k() { %0 = warp.no_such_op : f32 return }",
    "unknown type": "func.func @k(%a: !warp.nothing) attributes {warp.kernel} { return }",
    "zero vector": "func.func @k(%a: !warp.vec<0 x f32>) attributes {warp.kernel} { return }",
    "rank five": "func.func @k(%a: !warp.array<5 x f32>) attributes {warp.kernel} { return }",
    "undefined value": "func.func @k() { %0 = warp.sin(%x) : (f32) return }",
    "no terminator": "func.func @k() attributes {warp.kernel} { ",
    "wrong dialect type": "func.func @k(%a: !llvm.ptr<) { return }",
    "nested too deep": "(" * 100000,
    "unclosed string": 'func.func @k() attributes {a = "x} { return }',
}


@pytest.mark.parametrize("name", MALFORMED)
def test_library_refuses_malformed_text(name):
    with pytest.raises(errors.WarpError) as caught:
        _native.Module.from_text(MALFORMED[name])
    assert str(caught.value)


@pytest.mark.skipif(not WARP_OPT.exists(), reason="warp-opt is not built")
@pytest.mark.parametrize("name", MALFORMED)
def test_warp_opt_refuses_malformed_text(name):
    run = subprocess.run(
        [WARP_OPT, "--warp-pipeline=to-llvm", "-"],
        input=MALFORMED[name].encode(),
        capture_output=True,
        timeout=60,
    )
    assert run.returncode == 1, run.stderr.decode()
    assert b"error:" in run.stderr


@wp.kernel
def sample(x: wp.array(dtype=wp.vec3), y: wp.array(dtype=float), n: int):
    i = wp.tid()
    s = float(0.0)
    for k in range(n):
        if k % 2 == 0:
            s += wp.dot(x[i], x[k])
        else:
            s -= wp.length(x[k])
    y[i] += s


@pytest.mark.skipif(not WARP_OPT.exists(), reason="warp-opt is not built")
@pytest.mark.parametrize("stage", ["warp", "thread"])
def test_warp_opt_reads_back_what_the_library_prints(stage):
    text = sample.ir(stage=stage)
    run = subprocess.run([WARP_OPT, "-"], input=text.encode(), capture_output=True, timeout=60)
    assert run.returncode == 0, run.stderr.decode()
    again = subprocess.run([WARP_OPT, "-"], input=run.stdout, capture_output=True, timeout=60)
    assert again.stdout == run.stdout


FUZZ = """
import random, sys
import warp as wp
from warp import _native
from warp.extend import errors

text = open(sys.argv[1]).read()
accepted = refused = 0
for seed in range(int(sys.argv[2]), int(sys.argv[3])):
    rng = random.Random(seed)
    lines = text.splitlines()
    for _ in range(rng.randint(1, 3)):
        kind, k = rng.randrange(5), rng.randrange(len(lines))
        if kind == 0 and len(lines) > 1:
            del lines[k]
        elif kind == 1:
            lines.insert(k, lines[rng.randrange(len(lines))])
        elif kind == 2:
            words = lines[k].split(" ")
            rng.shuffle(words)
            lines[k] = " ".join(words)
        elif kind == 3 and lines[k]:
            c = rng.randrange(len(lines[k]))
            lines[k] = lines[k][:c] + rng.choice("%!<>(){}[]x3f,:=-\\"#@") + lines[k][c + 1:]
        else:
            lines[k] = lines[k].replace(*rng.choice([
                ("f32", "si32"), ("si32", "f32"), ("3 x", "2 x"), ("1 x", "4 x"),
                ("array", "vec"), ("vec", "array"), ("%", "%arg"), ("warp.", "arith."),
            ]))
    print("seed", seed, flush=True)
    try:
        module = _native.Module.from_text("\\n".join(lines))
    except errors.WarpError:
        refused += 1
        continue
    accepted += 1
    try:
        _native.Kernel(module, "sample").ir("llvm")
    except (errors.WarpError, KeyError, ValueError):
        pass
print("done", accepted, refused)
"""


def test_mutated_modules_never_crash(tmp_path):
    source = tmp_path / "sample.mlir"
    source.write_text(sample.ir(stage="warp"))
    program = programs.write_program(FUZZ)
    status, out, err = programs.run(program, source, 0, 400, timeout=280)
    last = out.splitlines()[-1] if out else ""
    assert status == 0, f"status {status} after {last}\n{err[-2000:]}"
    assert last.startswith("done")


def test_random_bytes_never_crash(tmp_path):
    rng, refused = random.Random(1), 0
    for _ in range(50):
        text = "".join(chr(rng.randrange(1, 256)) for _ in range(rng.randrange(200)))
        try:
            _native.Module.from_text(text)
        except (errors.WarpError, UnicodeError):
            refused += 1
    assert refused > 40
