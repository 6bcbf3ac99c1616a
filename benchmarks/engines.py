#!/usr/bin/env python3
"""Physics engines written for the peer, on the peer and on this package.

    engines.py --python PYTHON --package FOLDER [--steps N] [--device DEVICE]
               [--profile --scene SCENE... --worlds N] [--save FILE | --expected FILE]

PYTHON has `mujoco-warp`, `newton` and `warp-lang` installed; FOLDER holds this package and is put
in front of the peer's for its turns. Each engine runs one scene in a process of its own, first
with an empty kernel cache, then with the one that this left. A row of the table has seconds to
import and to make the first step, the same in seconds of processors (which hardly depend on what
else the machine does), and milliseconds per step after it; the last column is the largest
difference of the coordinates to the peer's, of which the peer's own are the scale. `--save` keeps
the peer's coordinates in a file; `--expected` takes them from it where the peer is not installed.

With `--profile` a table for each scene says where a step's time goes: launches, microseconds of
either package and their ratio by kernel, the slowest first, and the megabytes of the arrays that a
launch gets, with the bandwidth if it reads or writes all of them once; `slower` marks kernels that
take more than 1.05 times the peer's. `--save` and
`--expected` keep the peer's times likewise, so that one run on a machine with both gives the
figures that later runs are compared with; engines_h200.json has eight scenes by NVIDIA Warp 1.19.0
on an H200. Scenes (benchmarks/_engine_profile.py, _engine_newton.py) are those
of mujoco_warp's and Newton's own packages; on a GPU a step is a captured graph, as in training.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import tempfile
from pathlib import Path

CHILD = '''
import json, sys, time
begin = time.perf_counter()
import numpy as np
import warp as wp
wp.config.log_level = 30
engine, device, steps = sys.argv[1], sys.argv[2], int(sys.argv[3])
SCENE = """<mujoco><option timestep="0.005"/><worldbody><geom type="plane" size="5 5 .1"/>
<body pos="0 0 .6"><freejoint/><geom type="sphere" size=".2"/></body>
<body pos="0.1 0 1.2"><freejoint/><geom type="capsule" size=".1 .2"/></body>
<body pos="1 0 1"><joint type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .5 0 0" size=".05"/>
<body pos=".5 0 0"><joint type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .5 0 0" size=".05"/></body></body></worldbody></mujoco>"""

def mujoco_warp():
    import mujoco
    import mujoco_warp as engine
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    state = engine.put_model(model), engine.put_data(model, data, nworld=1)
    return lambda: engine.step(*state), lambda: state[1].qpos.numpy()[0]

def newton():
    import newton as engine
    builder = engine.ModelBuilder()
    builder.add_ground_plane()
    link = [builder.add_link() for _ in range(2)]
    for body in link:
        builder.add_shape_box(body, hx=0.5, hy=0.05, hz=0.05)
    turn = wp.quat_from_axis_angle(wp.vec3(0.0, 0.0, 1.0), 0.3)
    joints = [builder.add_joint_revolute(
        parent=-1, child=link[0], axis=wp.vec3(0.0, 1.0, 0.0),
        parent_xform=wp.transform(p=wp.vec3(0.0, 0.0, 5.0), q=turn),
        child_xform=wp.transform(p=wp.vec3(-0.5, 0.0, 0.0), q=wp.quat_identity()))]
    joints.append(builder.add_joint_revolute(
        parent=link[0], child=link[1], axis=wp.vec3(0.0, 1.0, 0.0),
        parent_xform=wp.transform(p=wp.vec3(0.5, 0.0, 0.0), q=wp.quat_identity()),
        child_xform=wp.transform(p=wp.vec3(-0.5, 0.0, 0.0), q=wp.quat_identity())))
    builder.add_articulation(joints)
    model = builder.finalize()
    solver = engine.solvers.SolverXPBD(model)
    states, control = [model.state(), model.state()], model.control()
    engine.eval_fk(model, model.joint_q, model.joint_qd, states[0])
    def step():
        states[0].clear_forces()
        solver.step(states[0], states[1], control, None, 0.002)
        states.reverse()
    return step, lambda: states[0].body_q.numpy().ravel()

with wp.ScopedDevice(device):
    step, result = {"mujoco-warp": mujoco_warp, "newton": newton}[engine]()
    wp.synchronize()
    imported, used = time.perf_counter(), time.process_time()
    step()
    wp.synchronize()
    stepped, worked = time.perf_counter(), time.process_time() - used
    for _ in range(steps - 1):
        step()
    wp.synchronize()
    timed = time.perf_counter()
    for _ in range(steps):
        step()
    wp.synchronize()
    each = (time.perf_counter() - timed) / steps
    final = result().astype(float).tolist()
times = [imported - begin, stepped - imported, used, worked, 1000.0 * each]
print("RESULT" + json.dumps([*times, final]))
'''


def run(options: argparse.Namespace, engine: str, package: Path | None, cache: str) -> list:
    """The report of one process; raises with its last lines if it fails."""
    environment = os.environ | {"WARP_CACHE_PATH": cache, "PYTHONPATH": str(package or "")}
    command = [options.python, "-c", CHILD, engine, options.device, str(options.steps)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    for line in done.stdout.splitlines():
        if line.startswith("RESULT"):
            return json.loads(line.removeprefix("RESULT"))
    raise SystemExit(f"{engine} failed:\n" + "\n".join(done.stderr.splitlines()[-8:]))


def profile(options: argparse.Namespace, scene: str, package: Path | None) -> dict:
    """The report of _engine_profile.py in a process of its own; raises with its last lines."""
    environment = os.environ | {"PYTHONPATH": str(package or "")}
    script = Path(__file__).with_name("_engine_profile.py")
    command = [options.python, str(script), scene, str(options.worlds), str(options.steps)]
    command.append(options.device)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    for line in done.stdout.splitlines():
        if line.startswith("RESULT"):
            return json.loads(line.removeprefix("RESULT"))
    raise SystemExit(f"{scene} failed:\n" + "\n".join(done.stderr.splitlines()[-8:]))


def difference(ours: dict, peer: dict | None) -> str:
    """The largest distance of the states after as many steps, relative to the largest number."""
    if peer is None or len(ours["final"]) != len(peer["final"]):
        return ""
    gap = max(abs(a - b) for a, b in zip(ours["final"], peer["final"], strict=True))
    return f", states differ by {gap / max(1.0, *map(abs, peer['final'])):.1e}"


def show(scene: str, worlds: int, ours: dict, peer: dict | None) -> None:
    """Prints the table of a scene."""
    other = peer or {"step_us": float("nan"), "launches": float("nan"), "kernels": {}}
    rate = worlds / ours["step_us"]
    print(
        f"{scene}, {worlds} worlds: a step {ours['step_us']:.1f} us (peer {other['step_us']:.1f}), "
        f"{rate:.3f} M steps/s, {ours['launches']:.0f} launches (peer {other['launches']:.0f}), "
        f"first step {ours['first_s']:.2f} s{difference(ours, peer)}"
    )
    print(f"{'us':>10}{'peer us':>10}{'ratio':>8}{'launches':>10}{'MB':>9}{'GB/s':>8}  kernel")
    kernels = sorted(ours["kernels"].items(), key=lambda item: -item[1][1])
    for name, (count, microseconds, size) in kernels:
        theirs = other["kernels"].get(name)
        known = theirs is not None and theirs[1] > 0
        ratio = microseconds / theirs[1] if known else float("nan")
        row = f"{microseconds:10.1f}{theirs[1] if known else float('nan'):10.1f}{ratio:8.2f}"
        rate = f"{1e3 * size / microseconds:8.0f}" if size and microseconds else 8 * " "
        row += f"{count:10.1f}{size / max(count, 1):9.2f}{rate}  {name[:60]}"
        print(row + (" slower" if ratio > 1.05 else ""))
    for name in sorted(set(other["kernels"]) - set(ours["kernels"])):
        print(f"{'':>10}{other['kernels'][name][1]:10.1f}{'':>35}  {name[:60]}, the peer's alone")


def profile_all(options: argparse.Namespace) -> None:
    """Profiles each scene with both packages, or with this one beside known times."""
    known = json.loads(options.expected.read_text()) if options.expected else {}
    for scene in options.scene or ("humanoid", "n_humanoid"):
        key = f"{scene}:{options.worlds}:{options.device}"
        if not options.expected:
            known[key] = profile(options, scene, None)
        show(scene, options.worlds, profile(options, scene, options.package), known.get(key))
    if options.save:
        options.save.write_text(json.dumps(known, indent=1))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", required=True)
    parser.add_argument("--package", type=Path, required=True)
    parser.add_argument("--engine", action="append", choices=("mujoco-warp", "newton"))
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--steps", type=int, default=50)
    parser.add_argument("--profile", action="store_true")
    parser.add_argument("--scene", action="append")
    parser.add_argument("--worlds", type=int, default=1024)
    parser.add_argument("--save", type=Path)
    parser.add_argument("--expected", type=Path)
    options = parser.parse_args()
    if options.profile:
        profile_all(options)
        return
    known = json.loads(options.expected.read_text()) if options.expected else {}
    packages = [("this", options.package)]
    if not options.expected:
        packages.insert(0, ("peer", None))
    columns = ("engine", "package", "cache", "import s", "first s", "import CPU", "first CPU")
    print(("{:>12}" * 9).format(*columns, "step ms", "difference"))
    for engine in options.engine or ("mujoco-warp", "newton"):
        for name, package in packages:
            with tempfile.TemporaryDirectory() as cache:
                for state in ("cold", "warm"):
                    *times, final = run(options, engine, package, cache)
                    expected = known.setdefault(engine, final)
                    gap = max(abs(a - b) for a, b in zip(final, expected, strict=True))
                    scale = max(1.0, *map(abs, expected))
                    row = "".join(f"{one:12.3f}" for one in times) + f"{gap / scale:12.1e}"
                    print(f"{engine:>12}{name:>12}{state:>12}{row}", flush=True)
    if options.save:
        options.save.write_text(json.dumps(known))


if __name__ == "__main__":
    main()
