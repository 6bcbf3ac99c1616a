"""Colours of graphs."""

import numpy as np
import pytest

import warp as wp

ALGORITHMS = list(wp.utils.GraphColoringAlgorithm)


def random_graph(rng, nodes, edges):
    return rng.integers(0, nodes, (edges, 2)).astype(np.int32)


def color(pairs, nodes, algorithm):
    edges = wp.array(np.reshape(pairs, (-1, 2)), dtype=int, device="cpu")
    colors = wp.zeros(nodes, dtype=int, device="cpu")
    count = wp.utils.graph_coloring_assign(edges, colors, algorithm)
    return count, colors, edges


def check(pairs, colors, count):
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    assert not np.any(colors[pairs[:, 0]] == colors[pairs[:, 1]])
    assert set(colors) == set(range(count))


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("nodes,edges", [(1, 0), (5, 3), (40, 60), (300, 2000)])
def test_random_graphs(algorithm, nodes, edges):
    pairs = random_graph(np.random.default_rng(nodes), nodes, edges)
    count, colors, _ = color(pairs, nodes, algorithm)
    check(pairs, colors.numpy(), count)
    unique = {frozenset(pair) for pair in pairs.tolist() if pair[0] != pair[1]}
    degree = np.bincount([node for pair in unique for node in pair], minlength=nodes)
    assert count <= degree.max(initial=0) + 1


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_fewest_colors_where_they_are_known(algorithm):
    path = np.array([(i, i + 1) for i in range(9)])
    assert color(path, 10, algorithm)[0] == 2
    complete = np.array([(i, j) for i in range(6) for j in range(i)])
    assert color(complete, 6, algorithm)[0] == 6
    # A chordal graph, for which both orders are optimal: triangles along a strip.
    strip = np.array([(i, i + k) for i in range(20) for k in (1, 2)])
    assert color(strip, 22, algorithm)[0] == 3


def test_balance_keeps_colors_valid_and_comes_closer():
    rng = np.random.default_rng(3)
    pairs = random_graph(rng, 200, 300)
    count, colors, edges = color(pairs, 200, ALGORITHMS[0])
    before = np.bincount(colors.numpy(), minlength=count)
    ratio = wp.utils.graph_coloring_balance(edges, colors, count, 1.1)
    after = np.bincount(colors.numpy(), minlength=count)
    check(pairs, colors.numpy(), count)
    assert ratio == after.max() / after.min() <= before.max() / before.min()


def test_balance_stops_at_the_limit_with_a_warning(capsys, monkeypatch):
    monkeypatch.setattr(wp.config, "quiet", False)
    edges = wp.zeros((0, 2), dtype=int, device="cpu")
    colors = wp.array([0] * 9 + [1], dtype=int, device="cpu")
    assert wp.utils.graph_coloring_balance(edges, colors, 2, 1.0, max_iterations=2) == 7 / 3
    assert "2-iteration limit" in capsys.readouterr().err
    assert wp.utils.graph_coloring_balance(edges, colors, 2, 1.0) <= 6 / 4


def test_groups():
    colors = wp.array([1, 0, 1, 3], dtype=int, device="cpu")
    groups = wp.utils.graph_coloring_get_groups(colors, 4)
    assert [list(group.numpy()) for group in groups] == [[1], [0, 2], [], [3]]
    groups = wp.utils.graph_coloring_get_groups(colors, 4, return_wp_array=False)
    assert [list(group) for group in groups] == [[1], [0, 2], [], [3]]


@pytest.mark.parametrize("edge", [(0, 2), (-1, 0)])
def test_edges_out_of_range_are_named(edge):
    with pytest.raises(RuntimeError, match=r"edge 0 has endpoints \(-?\d, \d\)"):
        color([edge], 2, ALGORITHMS[0])


def test_bad_arguments():
    colors = wp.zeros(2, dtype=int, device="cpu")
    assign = wp.utils.graph_coloring_assign
    with pytest.raises(RuntimeError, match=r"shape \(edge_count, 2\), but got \(1, 3\)"):
        assign(wp.zeros((1, 3), dtype=int, device="cpu"), colors)
    with pytest.raises(RuntimeError, match="'edges' expects elements of type 'int32'"):
        assign(wp.zeros((1, 2), dtype=float, device="cpu"), colors)
    with pytest.raises(RuntimeError, match="empty graph"):
        assign(wp.zeros((0, 2), dtype=int, device="cpu"), wp.zeros(0, dtype=int, device="cpu"))
    with pytest.raises(TypeError, match="max_iterations"):
        edges = wp.zeros((0, 2), dtype=int, device="cpu")
        wp.utils.graph_coloring_balance(edges, colors, 1, 1.0, max_iterations=1.5)


def test_the_search_needs_no_more_colors_than_the_greedy_order():
    fewer = 0
    for seed in range(60):
        pairs = random_graph(np.random.default_rng(seed), 30, 90)
        searched, greedy = (color(pairs, 30, algorithm)[0] for algorithm in ALGORITHMS)
        assert searched <= greedy
        fewer += searched < greedy
    assert fewer
