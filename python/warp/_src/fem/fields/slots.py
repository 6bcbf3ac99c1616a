"""Slots - reference values of a field at the point of a plan, and 0 or the field elsewhere."""

from types import SimpleNamespace
from typing import Any

import warp as wp
from warp._src.fem.fields.base import MARK


def slot_reference(description, half, other) -> SimpleNamespace:
    """Functions of (slots, argument, geometry, sample): a slot.

    Slots are value and gradient, on sides those of the outer cell, too.

    Args:
        description: of the field, with `moves`.
        other: functions at other samples; None for zero.
    """
    first = 0 if description.domain.is_cells else 2 * half
    second = first + 1
    moves = description.moves
    elsewhere = None if other is None else other[half]
    return SimpleNamespace(
        value=_slot(first, moves, elsewhere and elsewhere.value),
        gradient=_slot(second, moves, elsewhere and elsewhere.gradient),
    )


def _slot(position, moves, elsewhere):
    if not moves:

        @wp.func
        def slot(part: Any, arg: Any, geo: Any, s: Any):
            return part[position]

    elif elsewhere is None:

        @wp.func
        def slot(part: Any, arg: Any, geo: Any, s: Any):
            value = part[position]
            if s.test_dof[1] != MARK:
                value = type(value)()
            return value

    else:

        @wp.func
        def slot(part: Any, arg: Any, geo: Any, s: Any):
            value = part[position]
            if s.test_dof[1] != MARK:
                value = elsewhere(0, arg, geo, s)
            return value

    return slot
