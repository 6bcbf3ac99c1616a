"""Records as JSON lines, with where they come from."""

import contextlib
import datetime
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np

import warp as wp

#: Goes up when a record's fields change their meaning.
SCHEMA = 1


def provenance(devices):
    """The circumstances of a run's figures besides the scene."""
    names = {}
    for device in devices:
        if wp.is_device_available(device):
            names[device] = wp.get_device(device).name
    return {
        "schema": SCHEMA,
        "kind": "run",
        "time": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
        "warp": wp.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "system": platform.platform(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "devices": names,
        "commit": _commit(),
        "command": sys.argv[1:],
    }


def _processor():
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor()


def _commit():
    """Commit of the working folder, if it is a checkout."""
    try:
        found = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, timeout=5
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return found.stdout.strip() or None


class RecordFile:
    """Appends records to a file, each flushed, so that an interrupted run keeps what it has.

    A full disk or a folder that cannot be written is reported once; records stay in `records`.
    """

    def __init__(self, path, head):
        self.path, self.records, self.error = Path(path), [], None
        self._file = None
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = open(self.path, "w", encoding="utf-8")  # noqa: SIM115
        except OSError as error:
            self._fail(error)
        self._write(head)

    def append(self, record):
        self.records.append(record)
        self._write(record)

    def _write(self, record):
        if self._file is None:
            return
        try:
            self._file.write(json.dumps(record) + "\n")
            self._file.flush()
        except OSError as error:
            self._fail(error)

    def _fail(self, error):
        self.error = f"cannot write '{self.path}': {error.strerror or error}"
        print(f"warp.report: {self.error}; figures are kept in memory", file=sys.stderr)
        if self._file is not None:
            file, self._file = self._file, None
            with contextlib.suppress(OSError):
                file.close()

    def close(self):
        if self._file is not None:
            try:
                self._file.close()
            except OSError as error:
                self._fail(error)


def read_records(path):
    """A run's head and its records.

    Raises:
        ValueError: the file is not one of ours, or of another schema. A last line that an
            interrupted run left unfinished is dropped.
    """
    head, records = None, []
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines, 1):
        try:
            record = json.loads(line)
        except json.JSONDecodeError:
            if number == len(lines):
                break
            raise ValueError(f"{path}:{number}: expects one JSON object a line") from None
        if record.get("kind") == "run":
            if record.get("schema") != SCHEMA:
                raise ValueError(
                    f"{path}:{number}: expects schema {SCHEMA}, but got {record.get('schema')}"
                )
            head = record
        else:
            records.append(record)
    if head is None:
        raise ValueError(f"{path}: expects a report's JSON lines, but it has no line of kind 'run'")
    return head, records
