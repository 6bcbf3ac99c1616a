"""Numerical stability: a catalogue of stiff and extreme cases, each with its limits.

`python -m warp.report stability [CASE ...]` runs it. A case is 'pass' (within its limits),
'diagnosed' (no right result can be had and a message says so), 'absent' (the part is not in the
package and using it is an error) or 'fail': a wrong result, whose worst input is printed.
"""
