"""Noise is removed from many signals: Fourier transform, a filter, and back, in one kernel.

    python examples/tiles/spectrum_filter.py [--device cpu] [--signals 4096]

A block transforms a signal of 1024 samples (`tile_fft`), damps the frequencies above a cutoff by a
Gaussian and transforms back (`tile_ifft`, which does not divide by the length). Printed are the
error against NumPy in float64, the noise before and after, and signals per second beside NumPy's.
Writes build/demo/spectrum_filter_<device>.png.
"""

import argparse
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
LENGTH = 1024
CUTOFF = 24.0


@wp.kernel
def smooth(x: wp.array2d[wp.vec2], response: wp.array[float],
           y: wp.array2d[wp.vec2]):  # fmt: skip
    """One signal a block; the second component is the imaginary part."""
    i = wp.tid()
    t = wp.tile_load(x, shape=(1, LENGTH), offset=(i, 0))
    wp.tile_fft(t)
    damped = wp.tile_map(wp.mul, t, wp.tile_broadcast(
        wp.tile_load(response, shape=LENGTH), shape=(1, LENGTH)))  # fmt: skip
    wp.tile_ifft(damped)
    wp.tile_store(y, damped, offset=(i, 0))


def signals(count):
    """Smooth signals and the same with noise."""
    rng = np.random.default_rng(8)
    t = np.linspace(0.0, 1.0, LENGTH, endpoint=False)
    clean = np.zeros((count, LENGTH))
    for _ in range(5):
        height, frequency = rng.normal(size=(count, 1)), rng.integers(1, 12, (count, 1))
        phase = rng.uniform(0.0, 2.0 * np.pi, (count, 1))
        clean += height * np.sin(2.0 * np.pi * frequency * t + phase)
    return clean, clean + 0.5 * rng.normal(size=clean.shape)


def response():
    """The gain of each frequency."""
    frequency = np.fft.fftfreq(LENGTH, 1.0 / LENGTH)
    return np.exp(-0.5 * (frequency / CUTOFF) ** 2)


def picture(clean, noisy, filtered, path):
    """One signal, and spectra before and after."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.8), dpi=140, layout="constrained")
    left.plot(noisy, color="#bbbbbb", linewidth=0.6, label="with noise")
    left.plot(filtered, color="#1f6fb4", linewidth=1.4, label="filtered")
    left.plot(clean, color="black", linewidth=0.8, linestyle="--", label="without noise")
    left.set(xlabel="sample")
    left.legend(frameon=False)
    for values, color in ((noisy, "#bbbbbb"), (filtered, "#1f6fb4")):
        spectrum = np.abs(np.fft.rfft(values)) / LENGTH
        right.semilogy(np.maximum(spectrum, 1e-9), color=color, linewidth=0.8)
    right.set(xlabel="frequency", ylabel="amplitude", ylim=(1e-8, None))
    figure.savefig(path)
    plt.close(figure)


def fastest(work, count=5):
    """Least seconds of a few runs."""
    best = np.inf
    for _ in range(count):
        begin = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - begin)
    return best


def demonstrate(device, count, output):
    """Everything for one device; returns (error, noise before, noise after)."""
    clean, noisy = signals(count)
    factors = response()
    packed = np.stack([noisy, np.zeros_like(noisy)], axis=-1).astype(np.float32)
    x = wp.array(packed, dtype=wp.vec2, device=device)
    y = wp.zeros_like(x)
    scaled = wp.array(factors / LENGTH, dtype=float, device=device)

    def run():
        wp.launch_tiled(smooth, dim=count, inputs=[x, scaled], outputs=[y], block_dim=64,
                        device=device)  # fmt: skip
        wp.synchronize_device(device)

    run()
    expected = np.fft.ifft(np.fft.fft(noisy) * factors).real
    found = y.numpy()[..., 0]
    error = np.abs(found - expected).max() / np.abs(expected).max()
    before, after = (np.sqrt(np.mean((v - clean) ** 2)) for v in (noisy, found))
    ours = count / fastest(run)
    numpys = count / fastest(lambda: np.fft.ifft(np.fft.fft(noisy) * factors), 2)
    print(f"spectrum filter on {device}: {count} signals of {LENGTH} samples")
    print("\n| error | noise before | after | signals/s | NumPy's |\n|--:|--:|--:|--:|--:|")
    print(f"| {error:.1e} | {before:.3f} | {after:.3f} | {ours:.3g} | {numpys:.3g} |")
    picture(clean[0], noisy[0], found[0], output / f"spectrum_filter_{device.replace(':', '')}.png")
    return error, before, after


def main():
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", help="one device instead of all, such as cpu or cuda:0")
    parser.add_argument("--signals", type=int, default=4096)
    parser.add_argument("--output", type=Path, default=OUTPUT, help="folder of the picture")
    options = parser.parse_args()
    wp.config.quiet = True
    options.output.mkdir(parents=True, exist_ok=True)
    devices = [options.device] if options.device else [d.alias for d in wp.get_devices()]
    for device in devices:
        demonstrate(device, options.signals, options.output)


if __name__ == "__main__":
    main()
