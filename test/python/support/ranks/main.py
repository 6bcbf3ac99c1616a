"""All checks on ranks, in one process each: starting takes longer than most of them."""

import checking
import fixed_particle_checks
import forward_checks
import grid_checks
import lattice_checks
import operation_checks
import particle_checks
import process_checks
import solver_checks

MODULES = (
    *(grid_checks, lattice_checks, operation_checks, forward_checks),
    *(solver_checks, particle_checks, fixed_particle_checks, process_checks),
)

if __name__ == "__main__":
    checking.run([check for module in MODULES for check in module.CHECKS])
