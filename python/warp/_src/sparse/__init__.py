"""Sparse matrices of blocks, for `warp.sparse`.

`matrix`: the class; `storage`: its arrays; `lookup`: functions for kernels; `entries`: how blocks
are collected from contributions, which all operations that make a topology share; then one module
per kind of operation. Nothing here waits for a device unless its description says so.
"""
