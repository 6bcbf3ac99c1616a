"""Operations on whole arrays: scans, sorts, runs, sums, casts, colours of graphs."""

from warp._src.kernels.map_functions import create_warp_function as create_warp_function
from warp._src.utils.coloring import GraphColoringAlgorithm as GraphColoringAlgorithm
from warp._src.utils.coloring import graph_coloring_assign as graph_coloring_assign
from warp._src.utils.coloring import graph_coloring_balance as graph_coloring_balance
from warp._src.utils.coloring import graph_coloring_get_groups as graph_coloring_get_groups
from warp._src.utils.mesh_adjacency import MeshAdjacency as MeshAdjacency
from warp._src.utils.mesh_adjacency import MeshEdge as MeshEdge
from warp._src.utils.reductions import array_cast as array_cast
from warp._src.utils.reductions import array_inner as array_inner
from warp._src.utils.reductions import array_sum as array_sum
from warp._src.utils.sequences import array_scan as array_scan
from warp._src.utils.sequences import radix_sort_pairs as radix_sort_pairs
from warp._src.utils.sequences import runlength_encode as runlength_encode
from warp._src.utils.sequences import segmented_sort_pairs as segmented_sort_pairs
