"""A report: every point of every scene, then its pages."""

import sys
from pathlib import Path

from warp.report._pages import write_pages
from warp.report._peer import PeerWorker
from warp.report._records import RecordFile, provenance, read_records
from warp.report._worker import Worker


class Progress:
    """One line on a terminal that says how far a run is; silent elsewhere."""

    def __init__(self, total, file=sys.stderr):
        self.total, self.done, self.file = total, 0, file
        self.shown = total > 0 and file.isatty()

    def step(self, text):
        self.done += 1
        if self.shown:
            filled = 30 * self.done // self.total
            bar = "█" * filled + "·" * (30 - filled)
            print(f"\r{bar} {self.done}/{self.total}  {text[:40]:40}", end="", file=self.file)
            if self.done == self.total:
                print(file=self.file)


def run(
    scenes,
    *,
    devices=("cpu",),
    dtypes=None,
    sweeps=(),
    quick=False,
    output="build/report",
    baseline=None,
    against=None,
    repeats=10,
    budget=0.5,
    limit=60.0,
):
    """Measure scenes and write their pages.

    Args:
        scenes: `Scene`s.
        devices: such as ("cpu", "cuda:0"); one that is absent gives points 'unsupported'.
        dtypes: of those a scene runs in, which; all by default.
        sweeps: `Sweep`s in place of a scene's own of the same name.
        quick: fewer points, small sizes.
        output: folder; `records.jsonl`, `records.csv`, `report.md`, `report.html` and an SVG for
            each figure are written there.
        baseline: JSON lines of an earlier run, compared point by point.
        against: interpreter that has another package with this interface (NVIDIA Warp), by which
            every point is measured, too; records hold it as "peer".
        repeats: timed runs of a point, fewer where they pass `budget` seconds.
        limit: seconds a point may take before it is ended; None runs points in this process.

    Returns:
        The list of records. An interrupt (Ctrl-C) ends the run early: what was measured is kept,
        and the pages say so.

    Raises:
        ValueError: a sweep of a parameter that a scene does not have, a baseline that cannot be
            read.
    """
    earlier = read_records(baseline) if baseline else None
    points = [(scene, list(scene.cases(devices, dtypes, sweeps, quick))) for scene in scenes]
    head = provenance(devices) | {"quick": quick}
    file = RecordFile(Path(output) / "records.jsonl", head)
    progress = Progress(sum(len(cases) for _, cases in points))
    head["interrupted"] = False
    try:
        for scene, cases in points:
            worker = Worker(scene, limit, repeats, budget)
            peer = PeerWorker(against, scene, limit, repeats, budget) if against else None
            try:
                for case in cases:
                    record = worker.measure(case)
                    if peer:
                        record["peer"] = peer.measure(case)
                    file.append(record)
                    progress.step(f"{scene.name} {case.device} {case.dtype}")
            finally:
                worker.stop()
                if peer:
                    peer.stop()
    except KeyboardInterrupt:
        head["interrupted"] = True
    file.close()
    head["planned"], head["problem"] = progress.total, file.error
    write_pages(Path(output), head, file.records, scenes, earlier)
    return file.records
