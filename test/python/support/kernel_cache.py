"""The files in the folder of a kernel cache, and a program that fills it."""

import programs

# Launches as many kernels as its argument says, one without, and prints "right" and the number.
PROGRAM = programs.write_program("""
import sys
import warp as wp
wp.config.quiet = True

def make(c):
    @wp.kernel
    def scale(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = x[i] * c + 1.0
    return scale

count = int(sys.argv[1]) if len(sys.argv) > 1 else 1
x = wp.array([1.0, 2.0, 3.0], dtype=float, device="cpu")
for k in range(count):
    y = wp.zeros(3, dtype=float, device="cpu")
    wp.launch(make(float(k) + 2.0), 3, [x], [y], device="cpu")
    assert y.numpy().tolist() == [v * (k + 2.0) + 1.0 for v in (1.0, 2.0, 3.0)], y.numpy()
print("right", count)
""")


def codes(folder):
    """Pieces of machine code in a cache."""
    return len(list(folder.glob("*.code")))
