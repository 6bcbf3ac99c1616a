"""All checks on ranks, in one process each: starting takes longer than most of them."""

import checking
import grid_checks
import operation_checks
import solver_checks

if __name__ == "__main__":
    checking.run([*grid_checks.CHECKS, *operation_checks.CHECKS, *solver_checks.CHECKS])
