"""PyTorch's DataLoader: its workers launch kernels, as forks and as processes of their own."""

import json
import subprocess
import sys

import pytest

import programs

PROGRAM = """
import json, sys
import numpy as np
import torch.utils.data
import warp as wp

wp.config.quiet = True

@wp.kernel
def power(x: wp.array(dtype=float), n: int):
    i = wp.tid()
    r = float(1.0)
    for _ in range(n):
        r = r * x[i]
    x[i] = r

def powers(n):
    x = wp.array([2.0, 3.0], dtype=float, device="cpu")
    wp.launch(power, 2, [x, n], device="cpu")
    return x.numpy().copy()

class Powers(torch.utils.data.Dataset):
    def __len__(self):
        return 6

    def __getitem__(self, n):
        return powers(n), torch.utils.data.get_worker_info().id

def loaded(workers, method):
    loader = torch.utils.data.DataLoader(
        Powers(), batch_size=2, num_workers=workers, multiprocessing_context=method
    )
    batches = [*loader]
    values = np.concatenate([one.numpy() for one, _ in batches]).tolist()
    return values, sorted({int(w) for _, worker in batches for w in worker})

if __name__ == "__main__":
    # Forks come after the pool's threads have run.
    powers(2)
    found = {method: loaded(workers, method) for workers, method in ((2, "fork"), (1, "spawn"))}
    print(json.dumps([found, powers(3).tolist()]))
"""


def test_workers_launch_kernels():
    pytest.importorskip("torch")
    command = [sys.executable, programs.write_program(PROGRAM)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr[-3000:]
    found, after = json.loads(done.stdout.splitlines()[-1])
    wanted = [[2.0**n, 3.0**n] for n in range(6)]
    assert found == {"fork": [wanted, [0, 1]], "spawn": [wanted, [0]]}
    assert after == [8.0, 27.0]
