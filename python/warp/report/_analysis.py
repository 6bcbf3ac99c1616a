"""Results of a sweep's records: curves, orders, the time to reach an error, regressions."""

import itertools
import math
import statistics

from warp.report._measure import NOISE

#: Errors that the table of times is made for.
GOALS = (1e-2, 1e-3, 1e-6)
#: No method in use has a higher order.
STEEPEST = 12.0
#: Errors below are rounding of some hundred operations.
ROUNDING = {"float16": 5e-2, "float32": 6e-6, "float64": 1e-14}


def curve_key(record, axis):
    """The constants of a curve: device, dtype and the parameters besides the sweep's."""
    rest = {name: value for name, value in record["parameters"].items() if name != axis}
    return (record["device"], record["dtype"], tuple(rest.items()))


def curves_of(records, axis):
    """`{key: records}`, each in the order of the sweep."""
    found = {}
    for record in records:
        found.setdefault(curve_key(record, axis), []).append(record)
    return found


def label_of(key, fixed=()):
    """How a legend names a curve; parameters in `fixed` are the same everywhere."""
    device, dtype, rest = key
    words = [_word(name, value) for name, value in rest if name not in fixed]
    return ", ".join([*words, dtype, device])


def _word(name, value):
    return value if isinstance(value, str) else f"{name}={value:.3g}"


def error_names(records):
    """Names of all errors, those with a reference first."""
    names = {}
    for record in records:
        names.update(dict.fromkeys(record["bars"]))
        names.update(dict.fromkeys(record["errors"]))
    return list(names)


def time_to_error(curve, name, goal):
    """Shortest run time in seconds at which a curve reaches an error.

    Interpolates linearly in the logarithms between neighbouring points; the shortest over the
    curve, as a curve need not be monotone.

    Args:
        curve: records along a sweep.
        name: of the error.
        goal: the error to reach.

    Returns:
        Seconds, or None if the curve never reaches it.
    """
    points = [
        (record["errors"][name], record["seconds"]["median"])
        for record in curve
        if record["status"] == "ok" and name in record["errors"]
    ]
    reached = [seconds for error, seconds in points if error <= goal]
    for (e0, t0), (e1, t1) in itertools.pairwise(points):
        low, high = min(e0, e1), max(e0, e1)
        if 0.0 < low <= goal < high and t0 > 0.0 and t1 > 0.0:
            share = math.log(goal / e0) / math.log(e1 / e0)
            reached.append(t0 * (t1 / t0) ** share)
    return min(reached, default=None)


def observed_order(curve, axis, name):
    """Slope of log(error) over log(parameter) above the rounding floor, or None.

    Only stretches in which the error falls with the parameter count, and only errors well above
    the rounding of the curve's type. The median of the slopes is given where there are two at
    least, they agree within a half, and a method could have that order: what scatters more or is
    steeper is round-off or no power of the parameter.
    """
    points = sorted(
        (record["parameters"][axis], record["errors"][name])
        for record in curve
        if record["status"] == "ok"
        and ROUNDING.get(record["dtype"], 0.0) < record["errors"].get(name, 0.0) < 0.3
    )
    slopes = [
        math.log(e1 / e0) / math.log(h1 / h0)
        for (h0, e0), (h1, e1) in itertools.pairwise(points)
        if 0.0 < h0 < h1 and e1 > 1.2 * e0
    ]
    if len(slopes) < 2:
        return None
    order = statistics.median(slopes)
    agree = [slope for slope in slopes if abs(slope - order) <= 0.5 * order]
    is_power = 2 * len(agree) > len(slopes) and len(agree) >= 2 and order < STEEPEST
    return order if is_power else None


def table_of_times(records, axis, name):
    """`[(label key, order, [seconds or None per goal])]`, a row a curve."""
    rows = []
    for key, curve in curves_of(records, axis).items():
        times = [time_to_error(curve, name, goal) for goal in GOALS]
        rows.append((key, observed_order(curve, axis, name), times))
    return rows


def point_key(record):
    """The key by which two records of different runs are the same point."""
    parameters = tuple(sorted(record["parameters"].items()))
    return (record["scene"], record["device"], record["dtype"], parameters)


def compare(records, earlier):
    """Differences to an earlier run: `[(record, what, before, now, judgement)]`.

    Judgements are 'worse', 'better' or 'noise'. Times count as different only beyond 5 % and
    beyond the spread of both; errors beyond 5 % and their bars.
    """
    before = {point_key(record): record for record in earlier}
    rows = []
    for record in records:
        old = before.get(point_key(record))
        if old is None:
            continue
        if old["status"] != record["status"]:
            judgement = "better" if record["status"] == record["expected"] else "worse"
            rows.append((record, "status", old["status"], record["status"], judgement))
            continue
        for name, error in record["errors"].items():
            rows += _judge(record, f"error of {name}", old["errors"].get(name), error, 0.0)
        if "seconds" in record and "seconds" in old:
            spread = max(record["spread"], old["spread"])
            times = (old["seconds"]["median"], record["seconds"]["median"])
            rows += _judge(record, "run time", *times, spread)
    return rows


def _judge(record, what, before, now, spread):
    if not before or not now:
        return []
    ratio = now / before
    if abs(ratio - 1.0) <= max(NOISE, spread):
        return [(record, what, before, now, "noise")] if abs(ratio - 1.0) > 0.01 else []
    return [(record, what, before, now, "worse" if ratio > 1.0 else "better")]


def counts(records):
    """`{'green': n, 'amber': n, 'red': n}`."""
    found = {"green": 0, "amber": 0, "red": 0}
    for record in records:
        found[record["verdict"]] += 1
    return found


def scene_parameters(records):
    """Names of all parameters."""
    return list(dict.fromkeys(name for record in records for name in record["parameters"]))
