from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from care_core.causal import kernel as kernels
from care_core.causal.kernel import Kernel
from care_core.causal.mechanisms import JITTER, LEAST, TAIL, Mechanism, Transform, columns, restored, solve, transformed
from care_core.numbers import Floats
from care_core.records import replace

SETTINGS = st.floats(-1e3, 1e3)


def mechanism(*, binary: bool = False, transform: Transform = "identity", n: int = 30) -> Mechanism:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(n, 2))
    targets, kernel = np.sin(points[:, 0]), Kernel(np.array([0.5, 1.0]), 0.7, 0.4, 0.2)
    return Mechanism(
        inputs=("a", "b"),
        reads=np.arange(2),
        log_inputs=np.array([False, True]),
        centre=np.array([1.0, 0.5]),
        sd=np.array([2.0, 1.5]),
        kernel=kernel,
        points=points,
        targets=targets,
        weights=solve(kernel, points, targets),
        mean=0.3,
        scale=2.0,
        transform=transform,
        binary=binary,
        calibration=np.array([2.0, -0.1]) if binary else np.sort(rng.normal(size=101)),
    )


@pytest.mark.parametrize("transform", ["identity", "log", "log1p"])
def test_restored_undoes_transformed(transform: Transform) -> None:
    values = np.array([0.1, 1.0, 250.0])
    np.testing.assert_allclose(restored(transformed(values, transform), transform), values)
    assert (values > LEAST[transform]).all()


@given(arrays(float, (4, 2), elements=SETTINGS))
def test_probability_stay_off_zero_and_one(x: Floats) -> None:
    probability = mechanism(binary=True).probability(x)
    assert ((probability >= TAIL) & (probability <= 1 - TAIL)).all()


@given(st.lists(SETTINGS, min_size=1, max_size=20))
def test_the_distribution_of_errors_never_falls(z: list[float]) -> None:
    share = mechanism().share_below(np.sort(np.array(z)))
    assert (np.diff(share) >= 0).all()
    assert ((share >= TAIL) & (share <= 1 - TAIL)).all()


@given(arrays(float, (5, 2), elements=SETTINGS), st.permutations(range(5)))
def test_predictions_do_not_depend_on_the_order_of_rows(x: Floats, order: list[int]) -> None:
    m = mechanism()
    np.testing.assert_allclose(m.latent(x)[order], m.latent(x[order]), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(m.latent_sd(x)[order], m.latent_sd(x[order]), rtol=1e-9, atol=1e-12)


@given(arrays(float, (6, 2), elements=st.floats(-5, 5)))
def test_a_covariance_is_symmetric_and_never_negative(x: Floats) -> None:
    kernel = mechanism().kernel
    covariance = kernel(x, x)
    np.testing.assert_allclose(covariance, covariance.T)
    np.testing.assert_allclose(np.diag(covariance), kernel.variance)
    assert np.linalg.eigvalsh(covariance).min() > -1e-9


def test_a_change_is_known_better_than_the_values_it_lies_between() -> None:
    m, x = mechanism(), np.array([[0.0, 1.0], [3.0, 9.0], [1.0, 2.0]])
    sd = m.posterior(x).change_sd(m.posterior(x[:1]))
    assert sd[0] < 1e-4
    assert (sd <= 2 * m.latent_sd(x).max() + 1e-6).all()


def test_far_away_the_model_falls_back_to_the_mean_and_knows_nothing() -> None:
    m = mechanism()
    near, far = np.array([[1.0, np.exp(0.5)]]), np.array([[1e4, 1e12]])
    assert m.posterior(near).epistemic_ratio[0] < 0.2
    assert m.posterior(far).epistemic_ratio[0] == pytest.approx(1.0)
    assert m.latent(far)[0] == pytest.approx(m.mean)


def test_blocks_bound_memory_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    m, x = mechanism(), np.random.default_rng(1).uniform(1, 2, size=(50, 2))
    whole = m.latent(x)
    monkeypatch.setattr(kernels, "BLOCK", 100)
    np.testing.assert_allclose(m.latent(x), whole)


def test_a_value_that_has_no_logarithm_is_not_an_error() -> None:
    assert np.isfinite(mechanism().latent(np.array([[1.0, 0.0], [1.0, -3.0]]))).all()


@pytest.mark.parametrize("binary", [False, True])
def test_expected_is_in_the_targets_own_unit(binary: bool) -> None:
    m, x = mechanism(binary=binary, transform="identity" if binary else "log"), np.array([[0.0, 1.0]])
    np.testing.assert_allclose(m.expected(x), m.probability(x) if binary else np.exp(m.latent(x)))


def test_columns_follow_the_names() -> None:
    rows = [{"a": 1.0, "b": 2.0, "c": 3.0}, {"c": 6.0, "b": 5.0, "a": 4.0}]
    assert columns(rows, ["c", "a"]).tolist() == [[3.0, 1.0], [6.0, 4.0]]
    assert columns([], ["c", "a"]).shape == (0, 2)


@pytest.mark.parametrize("n", [1, 63, 64, 130, 300])
def test_points_among_themselves_are_the_same_numbers(n: int) -> None:
    points = np.random.default_rng(n).normal(size=(n, 5))
    points[:, 1:3] = points[:, 1:3].round()  # few values, which are looked up
    kernel = Kernel(np.array([0.1, 0.5, 1.0, 2.0, 0.0]), 0.7, 0.4, 0.1)
    np.testing.assert_array_equal(kernel.among(points), kernel(points, points))


def covariance(kernel: Kernel, a: Floats, b: Floats) -> Floats:
    """The formula of the kernel, word by word."""
    each = np.exp(-(((a[:, None] - b) * kernel.relevance) ** 2) / 2)
    additive = (each.sum(axis=2) + kernel.idle) / (len(kernel.relevance) + kernel.idle)
    return np.asarray(kernel.additive**2 * additive + kernel.joint**2 * each.prod(axis=2))


@given(
    arrays(float, (7, 3), elements=st.sampled_from([-2.0, -0.0, 0.0, 0.5, 1.25])),
    arrays(float, (4, 3), elements=st.floats(-3, 3)),
    st.integers(0, 2),
)
def test_values_that_many_points_share_change_no_covariance(b: Floats, a: Floats, idle: int) -> None:
    kernel = Kernel(np.array([0.3, 1.0, 2.0]), 0.7, 0.4, 0.1, idle)
    np.testing.assert_allclose(kernel(a, b), covariance(kernel, a, b), rtol=1e-12)
    np.testing.assert_allclose(kernel.among(b), covariance(kernel, b, b), rtol=1e-12)


def test_runs_of_the_same_inputs_count_as_one_outcome_and_no_less() -> None:
    """Against the formula with every run for itself (Rasmussen and Williams 2006, Eqs. 2.25 and 2.26)."""
    alone = mechanism()
    points = alone.points[np.random.default_rng(2).integers(0, 6, 30)]
    m = replace(alone, points=points, weights=solve(alone.kernel, points, alone.targets))
    z = np.random.default_rng(3).normal(size=(5, 2))
    x = np.column_stack((z[:, 0] * m.sd[0] + m.centre[0], np.exp(z[:, 1] * m.sd[1] + m.centre[1])))
    noisy = covariance(m.kernel, points, points) + (m.kernel.noise**2 + JITTER) * np.eye(30)
    cross = covariance(m.kernel, z, points)
    left = m.kernel.variance - np.einsum("mn,nm->m", cross, np.linalg.solve(noisy, cross.T))
    np.testing.assert_allclose(m.latent(x), m.mean + m.scale * cross @ np.linalg.solve(noisy, m.targets), rtol=1e-9)
    np.testing.assert_allclose(m.latent_sd(x), m.scale * np.sqrt(left), rtol=1e-7)
    assert len(m.training.counts) == 6


def test_a_kernel_of_no_inputs_is_a_constant() -> None:
    kernel = Kernel(np.zeros(0), 0.5, 0.0, 0.1, idle=1)
    np.testing.assert_allclose(kernel.among(np.zeros((3, 0))), np.full((3, 3), 0.25))
