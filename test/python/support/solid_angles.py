"""Winding numbers of meshes, in float64."""

import numpy as np


def exact_winding(corners, p):
    """The sum over triangles (m, 3, 3) of their solid angles at points (n, 3), over 4 pi.

    Van Oosterom and Strackee, "The solid angle of a plane triangle" (1983).
    """
    p = p.astype(np.float64)
    total = np.zeros(len(p))
    for triangle in corners.astype(np.float64):
        a, b, c = triangle[:, None] - p
        la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
        below = la * lb * lc
        for x, y, z in ((a, b, lc), (b, c, la), (c, a, lb)):
            below = below + (x * y).sum(axis=1) * z
        total += 2 * np.arctan2((a * np.cross(b, c)).sum(axis=1), below)
    return total / (4 * np.pi)
