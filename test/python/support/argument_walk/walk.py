"""The walk: wrong calls of a target by a seed."""

import random

from support.argument_walk import arguments, judge, objects, workers
from support.argument_walk.values import plausible, wrong_values

# Targets of one process.
_GROUP = 24


def _plan(target, seed, count, names):
    """The arguments of the calls: positions and names, by the names of their values.

    A third of the calls have wrong values only, a third values of the kinds that are expected, and
    the others one wrong value among right ones.
    """
    choose = random.Random(f"{seed} {target.name}")
    parameters = target.parameters
    for number in range(count):
        if parameters is None or (number % 3 == 2 and target.kind == "call"):
            least = 0 if parameters is None else max(0, len(parameters) - 3)
            most = 4 if parameters is None else len(parameters) + 1
            yield [(None, choose.choice(names)) for _ in range(choose.randint(least, most))]
            continue
        if number % 3 == 1 and target.kinds:
            yield list(_plausible(target, choose, names))
            continue
        wrong = choose.randrange(len(parameters)) if parameters else -1
        plan = []
        for position, name in enumerate(parameters):
            if position == wrong:
                plan.append((name, choose.choice(names)))
            elif name in arguments.RIGHT:
                plan.append((name, "right"))
        if choose.random() < 0.03:
            plan.append(("no_such_parameter", "None"))
        yield plan


def _plausible(target, choose, names):
    """Values of the kinds that the parameters expect, a right one now and then."""
    for name in parameters_of(target, choose):
        pool = plausible(target.kinds[name]) if name in target.kinds else ()
        if name in arguments.RIGHT and (not pool or choose.random() < 0.3):
            yield name, "right"
        elif pool:
            yield name, choose.choice(pool)
        elif choose.random() < 0.3:
            yield name, choose.choice(names)


def parameters_of(target, choose):
    """Names of the parameters; those beyond the first four now and then."""
    for position, name in enumerate(target.parameters):
        if position < 4 or choose.random() < 0.3:
            yield name


def _call(function, target, plan, values):
    named, positions = {}, []
    for name, value in plan:
        made = arguments.right(name) if value == "right" else values[value]()
        if name in arguments.ADDRESSES and isinstance(made, (int, float)):
            made = str(made)
        if name in arguments.WORK and type(made) is int:
            made = min(made, 3)
        if name is None or target.kind != "call":
            positions.append(made)
        else:
            named[name] = made
    function(*positions, **named)


def _tries(function, target, plan, values):
    """Makes a call; returns what is wrong with its answer."""
    try:
        _call(function, target, plan, values)
    except Exception as error:
        return None if target.kind == "use" else judge.problem(error)
    return None


def task(group, seed, count):
    """A task for `workers.run`: `count` calls for each target of a group."""

    def make(start, tell):
        values = wrong_values()
        names = sorted(values)
        number = 0
        for target in group:
            for plan in _plan(target, seed, count, names):
                if number >= start:
                    shown = ", ".join(f"{name}={value}" if name else value for name, value in plan)
                    tell("call", number, f"{target.name}({shown})")
                    held = objects.RECIPES[target.owner]() if target.owner else None
                    function = target.find(held) if target.owner else target.find()
                    wrong = _tries(function, target, plan, values)
                    if wrong:
                        tell("wrong", number, wrong)
                number += 1

    return make


def walk(targets, seed, count):
    """Failures of all targets' calls as (call, what is wrong), and how many calls there were."""
    failures, total = [], 0
    for first in range(0, len(targets), _GROUP):
        found, made = workers.run(task(targets[first : first + _GROUP], seed, count))
        failures += found
        total += made
    return failures, total
