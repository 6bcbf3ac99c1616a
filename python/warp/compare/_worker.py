"""One program by one package, measured: a script that other interpreters run.

    python _worker.py PACKAGE PROGRAM DEVICE FILE.npz REPEATS BUDGET

The file holds the inputs and the reference (`_programs.reference`). The last line printed is a
JSON object. Nothing but NumPy and the package is imported.
"""

import importlib
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np


class Memory:
    """Peak of the memory in use beyond that at the start: of the process, or of a GPU."""

    def __init__(self, device):
        self.gpu = device.startswith("cuda")
        if not self.gpu:
            with open("/proc/self/clear_refs", "w", encoding="ascii") as file:
                # Resets the peak.
                file.write("5")
        self.before = self._value("VmRSS")

    def _value(self, name):
        if self.gpu:
            command = ["nvidia-smi", "--query-gpu=memory.used", "--format=csv,noheader,nounits"]
            shown = subprocess.run(
                [*command, "-i", "0"], capture_output=True, text=True, check=True
            )
            return int(shown.stdout) * 1024
        for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
            if line.startswith(name + ":"):
                return int(line.split()[1])
        raise OSError(f"no {name} in /proc/self/status")

    def growth(self):
        """In MiB; of a GPU what is held now, since its peak is not recorded."""
        return (self._value("VmHWM") - self.before) / 1024.0


def timed(function):
    begin = time.perf_counter()
    function()
    return time.perf_counter() - begin


def run_times(function, repeats, budget):
    """The first run and the fastest of later ones, at least three, more within the budget.

    Other processes make runs longer, never shorter: on a shared machine the fastest is what stays.
    """
    first, times = timed(function), []
    while len(times) < 3 or (len(times) < repeats and sum(times) < budget):
        times.append(timed(function))
    return first, min(times)


def relative_error(value, exact):
    difference = np.linalg.norm((np.asarray(value, np.float64) - exact).ravel())
    return float(difference / np.linalg.norm(exact.ravel()))


def slope_error(gradient, data):
    """The error of the derivative along the direction of the finite differences."""
    found = float(np.sum(np.asarray(gradient, np.float64) * data["direction"]))
    return abs(found - float(data["slope"])) / abs(float(data["slope"]))


def load(file):
    """Inputs and reference, apart."""
    with np.load(file) as stored:
        data = {name: stored[name] for name in stored.files}
    inputs = {k[3:]: v for k, v in data.items() if k.startswith("in_")}
    inputs = {k: v.item() if v.ndim == 0 else v for k, v in inputs.items()}
    return inputs, {k: v for k, v in data.items() if not k.startswith("in_")}


def measure(package, program, device, file, repeats, budget):
    """A record; 'status' is 'ok' or 'absent', where the package has no such program."""
    inputs, exact = load(file)
    module = importlib.import_module(f"packages.with_{package}")
    record = {"version": module.VERSION, "status": "ok"}
    if program not in module.PROGRAMS:
        return record | {"status": "absent"}
    memory = Memory(device)
    run = module.build(program, inputs, exact.get("weights"), device)
    record["first_s"], record["forward_s"] = run_times(run.forward, repeats, budget)
    record["error"] = relative_error(run.result(), exact["result"])
    if run.backward and "slope" in exact:
        try:
            record["gradient_first_s"], record["gradient_s"] = run_times(
                run.backward, repeats, budget
            )
            record["gradient_error"] = slope_error(run.gradient(), exact)
        except Exception as error:
            record["gradient_reason"] = reason_of(error)
    return record | {"memory_mib": memory.growth()}


def reason_of(error):
    """An error as one line; of messages with a trace in them the end."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return f"{type(error).__name__}: {lines[-1] if lines else ''}"[:300]


def main():
    package, program, device, file, repeats, budget = sys.argv[1:]
    try:
        record = measure(package, program, device, file, int(repeats), float(budget))
    except Exception as error:
        record = {"status": "failed", "reason": reason_of(error)}
    print("\n" + json.dumps(record))


if __name__ == "__main__":
    main()
