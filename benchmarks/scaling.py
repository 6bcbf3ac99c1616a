"""Scaling: a model of many GPUs from counted bytes and measured rates, as a table.

    python benchmarks/scaling.py [--memory 4.28] [--network 45] [--phase 20] [--sum 50] [--step 25]

A step takes max(interior, halo) + shell + sums. Bytes of halos are those that blocks of n^3 cells
send; with hosts of 8 GPUs, three of six faces go over the network. Rates are arguments:
`test/device/scale.py` measures them on the GPUs of one host.
"""

import argparse

# Bytes that a cell of a lattice, or a row of a system, reads and writes in a step.
LATTICE, PLAIN, FUSED = 19 * 8, 56, 52
OVER_NETWORK = 3 / 6


def lattice_halo(n):
    """Bytes that a block of a D3Q19 lattice sends: five numbers a face cell, one an edge cell."""
    return 6 * n * n * 5 * 4 + 12 * n * 4


def stencil_halo(n):
    """Bytes that a block of a stencil of seven points sends."""
    return 6 * n * n * 4


def lattice(n, rates):
    """Seconds of compute and halo, and weak efficiencies with and without overlap."""
    whole = LATTICE * n**3 / rates.memory
    interior = LATTICE * (n - 2) ** 3 / rates.memory
    halo = rates.phase + OVER_NETWORK * lattice_halo(n) / rates.network
    step = max(interior, halo) + (whole - interior) + rates.step
    return whole, halo, whole / step, whole / (whole + halo)


def gradients(n, fused, rates):
    """Seconds of compute, halo and sums, and the weak efficiency, of an iteration of CG."""
    whole = (FUSED if fused else PLAIN) * n**3 / rates.memory
    halo = rates.phase + OVER_NETWORK * stencil_halo(n) / rates.network
    sums = (1 if fused else 2) * rates.sum
    # The halo travels beside the product of rows without ghosts, a third of the bytes or more.
    late = max(halo - whole / 3, 0.0)
    return whole, halo, sums, whole / (whole + late + sums)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, value, unit, text in (
        ("memory", 4.28, 1e12, "TB/s of a GPU's memory"),
        ("network", 45.0, 1e9, "GB/s of a GPU to other hosts"),
        ("phase", 20.0, 1e-6, "microseconds until the messages of a halo move"),
        ("sum", 50.0, 1e-6, "microseconds of an all-reduce of a number"),
        ("step", 25.0, 1e-6, "microseconds of the launches that unpack and compute the shell"),
    ):
        parser.add_argument(
            f"--{name}", type=lambda text, unit=unit: float(text) * unit, default=value * unit,
            help=f"{text}, by default {value:g}",
        )  # fmt: skip
    rates = parser.parse_args()
    print("| each GPU | bytes sent | compute ms | halo ms | sums ms | weak efficiency |")
    print("| --- | --- | --- | --- | --- | --- |")
    for n in (128, 256, 512):
        whole, halo, efficiency, alone = lattice(n, rates)
        print(
            f"| D3Q19, {n}^3 | {lattice_halo(n) / 1e6:.2g} MB | {whole * 1e3:.2g} "
            f"| {halo * 1e3:.2g} | | {efficiency:.2f}, without overlap {alone:.2f} |"
        )
    for n in (256, 512):
        for fused in (False, True):
            whole, halo, sums, efficiency = gradients(n, fused, rates)
            print(
                f"| CG, {n}^3, {'fused' if fused else 'plain'} | {stencil_halo(n) / 1e6:.2g} MB "
                f"| {whole * 1e3:.2g} | {halo * 1e3:.2g} | {sums * 1e3:.2g} | {efficiency:.2f} |"
            )


if __name__ == "__main__":
    main()
