"""Search for operands at which builtins lose all digits: `python -m warp.report search`.

For every overload of the registry that has a reference, random and adversarial operands (nearly
parallel, nearly singular, repeated, subnormal, huge, not of unit length) go through the builtin and
through its adjoint, and are held against mpmath. A number without a correct digit is a defect,
unless operands that differ by rounding errors have results that differ as much: then the problem
itself is ill-conditioned there, which the report says with the condition number.
"""
