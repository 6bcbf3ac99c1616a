"""The numbered cases of gradients, each with an expected value of its own."""

import pytest

import autodiff_catalogue

RUNS = autodiff_catalogue.runs()


@pytest.mark.parametrize(("number", "precision"), RUNS, ids=map("-".join, RUNS))
def test_case(number, precision, device):
    autodiff_catalogue.check_case(number, precision, device)
