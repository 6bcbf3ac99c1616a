"""Runs a kernel in every way that there is, and holds results against Python's bit for bit."""

import numpy as np

import threads_reference as reference
import warp as wp
from frontend_programs import define

# Options of kernels for each way to run threads.
MODES = {
    "normal": {},
    "debug": {"mode": "debug"},
    **{f"{lanes} lanes": {"cpu_lanes": lanes} for lanes in (1, 4, 8, 16)},
}


def modes_on(device):
    """The launches that differ on a device: lanes are of the CPU alone."""
    is_cpu = wp.get_device(device).is_cpu
    return {mode: one for mode, one in MODES.items() if is_cpu or "cpu_lanes" not in one}


# Around widths of vectors and of chunks.
SIZES = (0, 1, 3, 15, 16, 17, 63, 64, 65, 1000)


def bits(values):
    """Numbers as integers; every NaN is the same."""
    if values.dtype.kind != "f":
        return values
    values = np.where(np.isnan(values), values.dtype.type(np.nan), values)
    return values.view(f"u{values.dtype.itemsize}")


def assert_same(found, expected, message):
    """Fails unless arrays of two dictionaries have the same bits."""
    for name, want in expected.items():
        for part in want.dtype.names or (None,):
            got, other = (bits(one[part] if part else one) for one in (found[name], want))
            np.testing.assert_array_equal(got, other, err_msg=f"{name}.{part} {message}")


def compile_program(text, options):
    """The names of a text whose kernel `k` has `module_options=OPTIONS`."""
    return define(text, OPTIONS=options)


class Launches:
    """The kernel `k` of a text, in every mode and in Python.

    Args:
        text: the source; parameters are arrays first, then integers.
        elements: the type of each array, as the text would name it.
    """

    def __init__(self, text, elements):
        self.text, self.elements = text, elements
        self.spaces = {mode: compile_program(text, options) for mode, options in MODES.items()}
        self.names = reference.load(text)

    def check(self, dim, host, scalars, device, views=None):
        """Launch on copies of the arrays `host`, a dictionary; `views(arrays)` gives arguments."""
        views = views or (lambda arrays: list(arrays.values()))
        expected = {name: one.copy() for name, one in host.items()}
        wrapped = [
            reference.Array(one, eval(element, self.names))
            for one, element in zip(views(expected), self.elements, strict=True)
        ]
        reference.launch(self.names["k"], dim, [*wrapped, *map(np.int32, scalars)])
        for mode in modes_on(device):
            space = self.spaces[mode]
            arrays = {
                name: wp.array(one, dtype=eval(element, space), device=device)
                for (name, one), element in zip(host.items(), self.elements, strict=False)
            }
            wp.launch(space["k"], dim, [*views(arrays), *scalars], device=device)
            found = {name: one.numpy() for name, one in arrays.items()}
            message = f"in {mode} mode with {dim} threads of\n{self.text}"
            assert_same(found, expected, message)
