"""Points of scenes by another package with Warp's interface, in the interpreter that has it.

The interpreter runs this file as a script. It imports its own `warp`, then this package's
`warp.report` beside it, whose measurements need public names of Warp and NumPy alone.
"""

import contextlib
import importlib.util
import json
import os
import select
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent


def _serve(file, name, repeats, budget):
    """Answer cases, a line of JSON each, on the standard output that the process had at first."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    # Output of the package must not be taken for an answer.
    os.dup2(2, 1)
    import warp

    warp.config.quiet = True
    spec = importlib.util.spec_from_file_location(
        "warp.report", FOLDER / "__init__.py", submodule_search_locations=[str(FOLDER)]
    )
    warp.report = sys.modules["warp.report"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(warp.report)
    from warp.report._measure import measure, unpack_case
    from warp.report._scene import registered
    from warp.report._worker import load

    load(file)
    scene = registered()[name]
    print(json.dumps({"version": warp.__version__}), file=answers, flush=True)
    for line in sys.stdin:
        record = measure(scene, unpack_case(json.loads(line)), repeats, budget)
        kept = {key: record.get(key) for key in ("status", "reason", "errors", "seconds")}
        print(json.dumps(kept), file=answers, flush=True)


class PeerWorker:
    """Measures the points of one scene by another interpreter, each within `limit` seconds.

    Args:
        python: the interpreter.
    """

    def __init__(self, python, scene, limit, repeats, budget):
        self.limit, self.process, self.lost = limit or 600.0, None, None
        words = [scene.file, scene.name, str(repeats), str(budget)]
        self.command = [os.path.abspath(python), __file__, *words]

    def measure(self, case):
        """Status, reason, errors and seconds of a case."""
        question = {"device": case.device, "dtype": case.dtype}
        question |= {"parameters": case.parameters, "quick": case.quick}
        if self.lost is None and self.process is None:
            self._start()
        if self.lost is not None:
            return {"status": "failed", "reason": self.lost, "errors": {}}
        try:
            self.process.stdin.write((json.dumps(question) + "\n").encode())
            self.process.stdin.flush()
        except BrokenPipeError:
            pass
        found = self._answer()
        if found is not None:
            return found
        ended = self.process.poll() is not None
        self.stop()
        if ended:
            return {"status": "failed", "reason": "took its process down", "errors": {}}
        reason = f"did not end within {self.limit:g} s"
        return {"status": "timeout", "reason": reason, "errors": {}}

    def _start(self):
        variables = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        try:
            self.process = subprocess.Popen(
                self.command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env=variables,
            )
        except OSError as error:
            self.lost = f"cannot run '{self.command[0]}': {error.strerror}"
            return
        if self._answer() is None:
            self.process.kill()
            said = self.process.communicate()[1].decode(errors="replace").strip().splitlines()
            self.lost = said[-1] if said else f"'{self.command[0]}' did not start"
            self.process = None

    def _answer(self):
        """The next line as an object; None after `limit` seconds, or if the process has ended."""
        ready, _, _ = select.select([self.process.stdout], [], [], self.limit)
        line = self.process.stdout.readline() if ready else b""
        with contextlib.suppress(json.JSONDecodeError):
            return json.loads(line)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(1.0 if ready else 0.0)
        return None

    def stop(self):
        """End the process."""
        if self.process is not None:
            process, self.process = self.process, None
            process.kill()
            process.communicate()


if __name__ == "__main__":
    # The folder of a script comes first in the path, and has names of the standard library's kind.
    sys.path.pop(0)
    _serve(sys.argv[1], sys.argv[2], int(sys.argv[3]), float(sys.argv[4]))
