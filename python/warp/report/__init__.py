"""Error against run time: scenes with a reference, swept, timed and drawn.

    import numpy as np
    import warp as wp
    import warp.report as report

    @report.scene(
        sweep=report.Sweep("dt", 1e-1, 1e-3, 7),
        reference=report.Exact(lambda case: {"x": np.exp(-1.0)}),
    )
    def decay(case):
        x = wp.ones(1, dtype=case.real, device=case.device)
        ...
        return report.Program(run=run, quantities=lambda: {"x": x.numpy()})

`python -m warp.report FILE.py` runs the scenes of a file, `python -m warp.report` those that come
with the package; both write JSON lines, CSV, SVG, HTML and Markdown. `report.run` does the same
from Python. See `docs/report.md`.
"""

from warp.report._analysis import observed_order as observed_order
from warp.report._analysis import time_to_error as time_to_error
from warp.report._records import read_records as read_records
from warp.report._reference import Converged as Converged
from warp.report._reference import Exact as Exact
from warp.report._reference import Tabulated as Tabulated
from warp.report._run import run as run
from warp.report._scene import Case as Case
from warp.report._scene import Error as Error
from warp.report._scene import Program as Program
from warp.report._scene import Scene as Scene
from warp.report._scene import Series as Series
from warp.report._scene import Sweep as Sweep
from warp.report._scene import scene as scene
