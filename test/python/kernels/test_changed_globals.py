"""Notebooks: a global that changes after a kernel was compiled is named, once."""

import pytest

import programs

CELLS = '''
import warnings
import warp as wp
from IPython.core.interactiveshell import InteractiveShell

wp.config.quiet = True
shell = InteractiveShell.instance(colors="NoColor")


def cell(text):
    """The warnings that a cell makes."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        shell.run_cell(text, store_history=True).raise_error()
    print([str(one.message) for one in caught if "global" in str(one.message)])


KERNEL = """
@wp.func
def scale(a: float):
    return a * S

@wp.kernel
def g(x: wp.array[float]):
    x[wp.tid()] = scale(C)
"""
cell("import warp as wp; C = 3.0; S = 2.0; other = 1")
cell(KERNEL)
cell("x = wp.zeros(2, device='cpu'); wp.launch(g, 2, [x], device='cpu')")
cell("other = 2; C = 3.0")
cell("C = 4.0")
cell("C = 5.0")
cell("S = 7.0")
cell(KERNEL)
cell("wp.launch(g, 2, [x], device='cpu'); assert x.numpy().tolist() == [35.0, 35.0]")
cell("C = 5.0")
'''


def test_a_changed_global_is_named_once():
    """The kernel that was defined again has the numbers of then."""
    pytest.importorskip("IPython")
    status, out, err = programs.run(programs.write_program(CELLS))
    assert status == 0, err
    text = "global '{}' is {} now, but kernel 'g' was compiled with {}: "
    end = "run the cell that defines the kernel again"
    first, second = text.format("C", "4.0", "3.0") + end, text.format("S", "7.0", "2.0") + end
    quiet = ["[]"] * 4
    assert out.splitlines() == [*quiet, f'["{first}"]', "[]", f'["{second}"]', *["[]"] * 3]


def test_programs_without_ipython_load_none_of_it():
    program = """
import sys
import warp as wp

C = 3.0

@wp.kernel
def g(x: wp.array[float]):
    x[wp.tid()] = C

wp.launch(g, 2, [wp.zeros(2, device="cpu")], device="cpu")
print("warp._src.kernels.changed_globals" in sys.modules)
"""
    status, out, err = programs.run(programs.write_program(program))
    assert (status, out) == (0, "False\n"), err
