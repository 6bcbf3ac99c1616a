"""Fit the polynomials of erfinv and erfcinv in lib/Transforms/Lowerings.

With w = -log((1 - x) (1 + x)), erfinv(x) / x is smooth in w and, in the tail,
erfinv(x) / sqrt(w) is smooth in 1 / sqrt(w) (the variables are those of M. Giles,
"Approximating the erfinv function", GPU Computing Gems, 2011). Chebyshev
interpolation in 60 digits gives the coefficients, printed as C++ tables.

    python scripts/fit_erfinv.py
"""

import mpmath as mp

mp.mp.dps = 60


def erfcinv_from_w(w):
    """Return erfcinv(y) and y for y (2 - y) = exp(-w), y <= 1."""
    e = mp.e ** (-w)
    y = e / (1 + mp.sqrt(1 - e))
    if y > mp.mpf("1e-3"):
        return mp.erfinv(1 - y), y
    z = mp.sqrt(w)
    for _ in range(60):
        step = (mp.erfc(z) - y) * mp.sqrt(mp.pi) / 2 * mp.e ** (z * z)
        step = step / (1 - z * step)
        z += step
        if abs(step) < mp.mpf(10) ** -50 * z:
            break
    return z, y


def central(w):
    if w == 0:
        return mp.sqrt(mp.pi) / 2
    z, y = erfcinv_from_w(w)
    return z / (1 - y)


def tail(u):
    s = 1 / u
    z, _ = erfcinv_from_w(s * s)
    return z / s


def fit(function, low, high, degree):
    """Coefficients in t = (x - middle), lowest first."""
    n = degree + 1
    middle, half = (low + high) / 2, (high - low) / 2
    nodes = [mp.cos(mp.pi * (2 * k + 1) / (2 * n)) for k in range(n)]
    values = [function(middle + half * t) for t in nodes]
    cheb = [
        2
        / mp.mpf(n)
        * sum(v * mp.cos(mp.pi * j * (2 * k + 1) / (2 * n)) for k, v in enumerate(values))
        for j in range(n)
    ]
    cheb[0] /= 2
    # Chebyshev to monomials in t / half.
    polys = [[mp.mpf(1)], [mp.mpf(0), mp.mpf(1)]]
    while len(polys) < n:
        shifted = [mp.mpf(0)] + [2 * c for c in polys[-1]]
        for i, c in enumerate(polys[-2]):
            shifted[i] -= c
        polys.append(shifted)
    mono = [mp.mpf(0)] * n
    for c, p in zip(cheb, polys):
        for i, a in enumerate(p):
            mono[i] += c * a
    mono = [c / half**i for i, c in enumerate(mono)]
    worst = mp.mpf(0)
    for k in range(201):
        t = low + (high - low) * k / 200
        p = sum(c * (t - middle) ** i for i, c in enumerate(mono))
        worst = max(worst, abs(p / function(t) - 1))
    return middle, mono, worst


def table(name, function, low, high, degree):
    """Print one polynomial, the highest coefficient first."""
    middle, mono, worst = fit(function, mp.mpf(low), mp.mpf(high), degree)
    print(f"/// On [{low}, {high}]; relative error {mp.nstr(worst, 2)}.")
    print(f"constexpr double {name}[] = {{")
    for c in reversed(mono):
        print(f"    {mp.nstr(c, 17)},")
    print("};")
    print(f"constexpr double {name}Middle = {mp.nstr(middle, 17)};\n")


TABLES = [
    ("singleCentral", central, "0", "5.5", 9),
    ("singleTail", tail, "0.097", "0.4265", 9),
    ("doubleCentral", central, "0", "6.5", 23),
    ("doubleTail", tail, "0.2", "0.3925", 20),
    ("doubleFarTail", tail, "0.09", "0.2", 16),
    ("doubleFarthestTail", tail, "0.036", "0.09", 16),
]

if __name__ == "__main__":
    for name, function, low, high, degree in TABLES:
        table(name, function, low, high, degree)
