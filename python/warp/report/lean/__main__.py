"""Command line: `python -m warp.report lean SCENE ...`."""

import collections
import dataclasses
import gc
import json
import sys
import tempfile
from pathlib import Path

import warp as wp
from warp import extend
from warp.report._command import choose, make_parser
from warp.report._remote import LostWorkError, Remote
from warp.report._scene import registered
from warp.report._worker import load


@dataclasses.dataclass
class Lean:
    """The parts that one run of a scene used.

    Attributes:
        scene: its name.
        launches: how often each kernel was launched.
        kernels: entries of `wp.manifest`, as dictionaries.
        array_bytes, gradient_bytes: of the arrays that are alive after the run.
        modules: parts of the package that were imported, beyond those of `import warp`.
        unused: what is present but unused, a line each.
    """

    scene: str
    launches: dict
    kernels: list
    array_bytes: int
    gradient_bytes: int
    modules: list
    unused: list

    def __str__(self):
        lines = [f"{self.scene}: {sum(self.launches.values())} launches a run"]
        for one in self.kernels:
            count = self.launches.get(one["kernel"], 0) if one["variant"] == "forward" else "-"
            library = ", ".join(one["library"]) or "none"
            lines.append(
                f"  {one['kernel']} ({one['variant']}): {count} launches, "
                f"{one['instructions']} instructions, library: {library}"
            )
        lines.append(f"  arrays: {self.array_bytes} bytes, gradients: {self.gradient_bytes} bytes")
        lines.append(f"  imported: {', '.join(self.modules) or 'nothing more'}")
        return "\n".join([*lines, *(f"  unused: {line}" for line in self.unused or ["nothing"])])


class _Counter:
    """Counts launches by kernel."""

    def __init__(self):
        self.launches = collections.Counter()

    def measure(self, kind, name, device, run):
        if name.startswith("forward kernel "):
            self.launches[name.removeprefix("forward kernel ")] += 1
        return run()


def measure(name, device="cpu"):
    """A `Lean` of one run of a scene, at its first point."""
    scene = registered()[name]
    case = next(iter(scene.cases((device,), quick=True)))
    before = set(sys.modules)
    known = {(one.kernel, one.module) for one in wp.manifest()}
    program = scene.build(case)
    counter = _Counter()
    with extend.measured_by(counter):
        if program.reset:
            program.reset()
        program.run()
        if program.gradient:
            program.gradient()
    entries = [e for e in wp.manifest(code=True) if (e.kernel, e.module) not in known]
    # Annotations pass `isinstance`, too.
    arrays = [one for one in gc.get_objects() if issubclass(type(one), wp.array)]
    arrays = [one for one in arrays if one.device == device]
    own = {one.grad.ptr for one in arrays if one.grad_in_use is not None}
    gradients = [one for one in arrays if one.grad_in_use is not None]
    plain = {one.ptr: one for one in arrays if one.ptr not in own}.values()
    found = Lean(
        scene=name,
        launches=dict(counter.launches),
        kernels=[dataclasses.asdict(entry) for entry in entries],
        array_bytes=sum(one.capacity for one in plain),
        gradient_bytes=sum(one.grad.capacity for one in gradients),
        modules=sorted({_part(m) for m in set(sys.modules) - before if m.startswith("warp.")}),
        unused=wp.Manifest(entries).unused,
    )
    _note_unused(found, gradients, entries, counter)
    return found


def _part(module):
    """The part of the package that a module belongs to."""
    return ".".join(module.replace("warp._src.", "").replace("warp.", "").split(".")[:1])


def _note_unused(found, gradients, entries, counter):
    if gradients and not any(entry.variant in ("adjoint", "tangent") for entry in entries):
        found.unused.append(f"{found.gradient_bytes} bytes of gradients that no pass reads")
    for entry in entries:
        if entry.variant == "forward" and not counter.launches[entry.kernel]:
            found.unused.append(f"kernel '{entry.kernel}': translated and not launched")


def prepare(folder, files):
    """Register scenes; the function that measures one, with a cache of kernels of its own."""
    wp.config.quiet = True
    wp.config.kernel_cache_dir = folder
    for file in files:
        load(file)
    return lambda question: measure(*question)


def main(arguments=None):
    """Run; the exit status is 1 if something is unused or fails, 2 for a wrong command."""
    parser = make_parser("lean", limit="a scene", output="lean.jsonl")
    parser.add_argument("scenes", nargs="*", help="names of scenes, or Python files with some")
    options = parser.parse_args(arguments)
    try:
        wp.get_device(options.device)
        scenes = choose(options.scenes)
    except (ValueError, OSError, wp.WarpError) as error:
        print(f"warp.report lean: {error}", file=sys.stderr)
        return 2
    good, lines = True, []
    with tempfile.TemporaryDirectory() as folder:
        for scene in scenes:
            # Each in a process of its own: what one imports is no part of another.
            remote = Remote(prepare, (folder, [scene.file]), options.limit)
            try:
                found = remote.ask((scene.name, options.device))
            except LostWorkError as lost:
                print(f"{scene.name}: {lost}")
                good = False
                continue
            finally:
                remote.stop()
            print(found, flush=True)
            lines.append(json.dumps(dataclasses.asdict(found)))
            good &= not found.unused
    Path(options.output).mkdir(parents=True, exist_ok=True)
    (Path(options.output) / "lean.jsonl").write_text("\n".join(lines) + "\n")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
