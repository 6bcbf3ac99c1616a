"""Solvers of linear systems: iterative ones, also of operators made by hand, and direct ones."""

from warp._src.optim.linear.bicgstab import BiCGSTAB as BiCGSTAB
from warp._src.optim.linear.chebyshev import Chebyshev as Chebyshev
from warp._src.optim.linear.conjugate import CG as CG
from warp._src.optim.linear.conjugate import CR as CR
from warp._src.optim.linear.direct import DirectSolver as DirectSolver
from warp._src.optim.linear.direct import cholesky as cholesky
from warp._src.optim.linear.direct import ldlt as ldlt
from warp._src.optim.linear.direct import lu as lu
from warp._src.optim.linear.direct import qr as qr
from warp._src.optim.linear.direct_factors import FactorError as FactorError
from warp._src.optim.linear.fsai import FSAI as FSAI
from warp._src.optim.linear.functions import bicgstab as bicgstab
from warp._src.optim.linear.functions import cg as cg
from warp._src.optim.linear.functions import cr as cr
from warp._src.optim.linear.functions import gmres as gmres
from warp._src.optim.linear.gmres import GMRES as GMRES
from warp._src.optim.linear.operators import LinearOperator as LinearOperator
from warp._src.optim.linear.operators import aslinearoperator as aslinearoperator
from warp._src.optim.linear.preconditioners import preconditioner as preconditioner
from warp._src.optim.linear.state import LinearSolverState as LinearSolverState
