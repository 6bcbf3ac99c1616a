"""One point: build, run, time, compare; always a record, whatever the scene does."""

import math
import statistics
import time
import traceback

import numpy as np

import warp as wp
from warp.report._reference import MARGIN, relative_error
from warp.report._scene import Case, Error, Program, Series

#: The error quantiles of repeated runs may differ by this before a difference means something.
NOISE = 0.05
#: Points of a series that a record keeps.
KEPT = 400


def quantities_of(scene, case):
    """The untimed results of a scene for a case; for references."""
    program = _build(scene, case)
    if program.reset:
        program.reset()
    program.run()
    found = program.quantities()
    if program.gradient:
        found["gradient"] = np.asarray(program.gradient())
    return {
        name: value if isinstance(value, (Series, Error)) else np.asarray(value)
        for name, value in found.items()
    }


def _build(scene, case):
    program = scene.build(case)
    if not isinstance(program, Program):
        raise TypeError(
            f"scene '{scene.name}' expects its function to return a report.Program, "
            f"but got {type(program).__name__}"
        )
    return program


def _timed(function, device):
    wp.synchronize_device(device)
    begin = time.perf_counter()
    result = function()
    wp.synchronize_device(device)
    return time.perf_counter() - begin, result


def _repeat(program, device, repeats, budget):
    """First run and repeated ones; at least three unless one takes longer than the budget."""

    def once():
        if program.reset:
            program.reset()
        return _timed(program.run, device)[0]

    first = once()
    times = [once()]
    while len(times) < repeats and (sum(times) < budget or len(times) < 3):
        if times[-1] > budget:
            break
        times.append(once())
    return first, times


def measure(scene, case, repeats=10, budget=0.5):
    """Run one point of a sweep.

    Args:
        repeats: runs that are timed after the first, fewer where they pass `budget` seconds.

    Returns:
        A dictionary that JSON can hold; `status` is 'ok', 'diverged', 'nonfinite', 'failed' or
        'unsupported', and `reason` says why.
    """
    record = {
        "scene": scene.name,
        "device": case.device,
        "dtype": case.dtype,
        "parameters": dict(case.parameters),
        "status": "ok",
        "reason": "",
        "expected": scene.expect(case),
        "errors": {},
        "unjudged": {},
        "bars": {},
        "series": {},
    }
    try:
        if not wp.is_device_available(case.device):
            raise NotImplementedError(f"no device '{case.device}' here")
        _measure(scene, case, record, repeats, budget)
    except NotImplementedError as error:
        record |= {"status": "unsupported", "reason": str(error)}
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        reason = f"{type(error).__name__}: {error} ({where.filename}:{where.lineno})"
        record |= {"status": "failed", "reason": reason}
    record["verdict"] = verdict(scene, case, record)
    return record


def _measure(scene, case, record, repeats, budget):
    setup, program = _timed(lambda: _build(scene, case), case.device)
    first, times = _repeat(program, case.device, repeats, budget)
    median = statistics.median(times)
    ordered = sorted(times)
    record["seconds"] = {
        "setup": setup,
        "first": max(first - median, 0.0),
        "median": median,
        "least": ordered[0],
        "p95": ordered[math.ceil(0.95 * len(ordered)) - 1],
        "repeats": len(times),
    }
    record["spread"] = (record["seconds"]["p95"] - ordered[0]) / median if median else 0.0
    read, found = _timed(program.quantities, case.device)
    record["seconds"]["read"] = read
    if program.gradient:
        times = [_timed(program.gradient, case.device) for _ in range(3)]
        record["seconds"]["gradient"] = statistics.median(seconds for seconds, _ in times)
        found["gradient"] = np.asarray(times[-1][1])
        record["gradient_norm"] = float(np.linalg.norm(found["gradient"].ravel()))
    if program.work:
        record["rate"] = program.work / median
    if case.parts:
        case.profiling = True
        if program.reset:
            program.reset()
        _timed(program.run, case.device)
        record["parts"] = dict(case.parts)
    _compare(scene, case, record, found)


def _compare(scene, case, record, found):
    arrays = {n: np.asarray(v) for n, v in found.items() if not isinstance(v, (Series, Error))}
    broken = [name for name, value in arrays.items() if not np.isfinite(value).all()]
    for name, value in found.items():
        if isinstance(value, Error):
            record["errors"][name] = float(value.value)
        elif isinstance(value, Series):
            _keep_series(record, name, value)
    broken += [name for name, error in record["errors"].items() if not math.isfinite(error)]
    if broken:
        record |= {"status": "nonfinite", "reason": f"'{broken[0]}' is not finite"}
        return
    if scene.reference is not None and arrays:
        values, bars = scene.reference.evaluate(scene, case, quantities_of)
        for name in arrays.keys() & values.keys():
            error = relative_error(arrays[name], values[name])
            record["bars"][name] = bars[name]
            judged = error >= MARGIN * bars[name] or error == 0.0
            record["errors" if judged else "unjudged"][name] = error
    worst = max(record["errors"].items(), key=lambda item: item[1], default=None)
    if worst and worst[1] > scene.diverged:
        record |= {"status": "diverged", "reason": f"error of '{worst[0]}' is {worst[1]:.2e}"}


def _keep_series(record, name, series):
    times = np.asarray(series.time, np.float64)
    errors = np.asarray(series.error, np.float64)
    with np.errstate(all="ignore"):
        record["errors"][name] = float(np.abs(errors).max()) if errors.size else 0.0
    index = np.linspace(0, len(times) - 1, min(len(times), KEPT)).astype(int)
    record["series"][name] = [times[index].tolist(), errors[index].tolist()]


def verdict(scene, case, record):
    """'green', 'amber' or 'red'.

    Green is what a right program does there, within the scene's limits. Amber could not be run
    here, or was expected to diverge and did not; red is a wrong result, or none.
    """
    status, expected = record["status"], record["expected"]
    if status == "unsupported":
        return "amber"
    if status in ("failed", "timeout"):
        return "red"
    if expected == "any":
        return "green"
    if expected == "diverged":
        return "green" if status in ("diverged", "nonfinite") else "amber"
    if status != "ok":
        return "red"
    limits = scene.limits(case)
    passed = [name for name, limit in limits.items() if record["errors"].get(name, 0.0) > limit]
    if passed:
        record["reason"] = (
            f"error of '{passed[0]}' is {record['errors'][passed[0]]:.2e}, "
            f"limit {limits[passed[0]]:.1e}"
        )
        return "red"
    return "green"


def unpack_case(data):
    """The `Case` that a worker process was sent."""
    return Case(data["device"], data["dtype"], data["parameters"], data["quick"])
