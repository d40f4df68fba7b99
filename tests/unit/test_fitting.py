from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import check_grad
from threadpoolctl import threadpool_limits

from care_core.causal.kernel import Kernel
from care_core.causal.mechanisms import JITTER, Mechanism
from care_core.errors import LearningError
from care_core.learn.fitting import (
    RELEVANCE_SCALE,
    WEAK,
    Effort,
    Inputs,
    _Posterior,
    best_transform,
    fit_mechanism,
)
from care_core.learn.skill import calibration_error
from care_core.numbers import Floats
from care_core.records import replace

RNG = np.random.default_rng
FULL = Effort(points=300, iterations=60)


def inputs(count: int, *logs: int) -> Inputs:
    return Inputs.all_read(tuple("abcdefgh"[:count]), np.isin(np.arange(count), logs))


def fitted(x: Floats, y: Floats, *, binary: bool = False, effort: Effort = FULL) -> Mechanism:
    with threadpool_limits(1):
        return fit_mechanism(x, y, inputs(x.shape[1]), binary=binary, rng=RNG(0), effort=effort)


def test_recovers_a_known_function_from_clean_data() -> None:
    def truth(x: Floats) -> Floats:
        return np.asarray(50 + np.sin(3 * x[:, 0]) + x[:, 1] ** 2 + x[:, 0] * x[:, 2])

    x, new = RNG(0).uniform(-1, 1, (200, 4)), RNG(1).uniform(-0.9, 0.9, (200, 4))
    m = fitted(x, truth(x))
    error = m.expected(new) - truth(new)
    assert np.sqrt((error**2).mean()) < 0.05 * truth(new).std()
    relevance = dict(zip(m.reads.tolist(), m.kernel.relevance.tolist(), strict=True))
    assert relevance.get(3, 0.0) < 0.2 * min(relevance[i] for i in range(3))


def test_a_straight_line_keeps_its_small_slopes_and_loses_what_moves_nothing() -> None:
    rng = np.random.default_rng(0)
    x = rng.normal(size=(200, 4))
    y = x[:, 0] + 0.1 * x[:, 1] + 0.1 * x[:, 2] + 0.1 * rng.normal(size=200)
    mechanism = fitted(x, y)
    assert mechanism.reads.tolist() == [0, 1, 2]
    near, far = np.zeros((1, 4)), np.array([[0.0, 1.0, 0.0, 0.0]])
    assert mechanism.latent(far)[0] - mechanism.latent(near)[0] == pytest.approx(0.1, abs=0.03)


def test_among_few_runs_no_input_is_left_out() -> None:
    x = RNG(0).uniform(-1, 1, (60, 3))
    y = RNG(1).normal(size=60)  # nothing moves it
    read = [
        fit_mechanism(x, y, replace(inputs(3), least=least), binary=False, rng=RNG(0), effort=FULL).reads.tolist()
        for least in (0.0, WEAK)
    ]
    assert read == [[], [0, 1, 2]]


def test_knows_less_away_from_the_data() -> None:
    x = RNG(0).uniform(0, 1, (80, 2))
    m = fitted(x, x[:, 0] + 0.1 * RNG(1).normal(size=80))
    inside, outside = (
        m.posterior(np.array([[0.5, 0.5]])).epistemic_ratio,
        m.posterior(np.array([[4.0, 0.5]])).epistemic_ratio,
    )
    assert inside[0] < 0.1 < outside[0]


def test_intervals_hold_what_they_promise() -> None:
    """Of new runs, eight of ten fall inside the 80% interval."""
    x, new = RNG(0).uniform(0, 1, (200, 3)), RNG(1).uniform(0, 1, (1000, 3))
    noise = 0.2 * RNG(2).standard_t(5, size=1200)
    m = fitted(x, 2 * x[:, 0] + noise[:200])
    y = 2 * new[:, 0] + noise[200:]
    sd = np.sqrt(m.latent_sd(new) ** 2 + m.noise_sd**2)
    below = m.share_below(((y if m.transform == "identity" else np.log(y)) - m.latent(new)) / sd)
    assert 0.74 < ((below > 0.1) & (below < 0.9)).mean() < 0.86


def test_probabilities_are_better_than_the_base_rate_and_calibrated() -> None:
    x = RNG(0).uniform(-1, 1, (1300, 4))
    chance = 1 / (1 + np.exp(-(4 * x[:, 0] + 3 * x[:, 1] ** 2 - 1)))
    y = (RNG(1).random(1300) < chance).astype(float)
    m = fitted(x[:300], y[:300], binary=True)
    probability, seen = m.probability(x[300:]), y[300:]
    base = y[:300].mean()

    def log_loss(p: Floats) -> float:
        return float(-(seen * np.log(p) + (1 - seen) * np.log(1 - p)).mean())

    assert log_loss(probability) < 0.8 * log_loss(np.full(1000, base))
    assert log_loss(probability) < 1.1 * log_loss(chance[300:])
    assert calibration_error(probability, seen) < 0.07


def test_probability_of_what_no_input_explains_are_the_base_rate() -> None:
    x, y = RNG(0).uniform(size=(200, 3)), (RNG(1).random(200) < 0.2).astype(float)
    probability = fitted(x, y, binary=True).probability(RNG(2).uniform(size=(50, 3)))
    np.testing.assert_allclose(probability, y.mean(), atol=0.1)


def test_all_of_one_class_is_no_error() -> None:
    probability = fitted(RNG(0).uniform(size=(30, 2)), np.ones(30), binary=True).probability(np.array([[0.5, 0.5]]))
    assert probability[0] > 0.9


def test_a_constant_input_and_a_constant_target_are_no_error() -> None:
    x = np.column_stack([RNG(0).uniform(size=40), np.ones(40)])
    assert fitted(x, np.full(40, 7.0)).expected(x[:2]).tolist() == pytest.approx([7.0, 7.0])
    assert np.isfinite(fitted(x, x[:, 0]).expected(x)).all()


def test_too_few_runs_are_refused() -> None:
    with pytest.raises(LearningError, match="needs 20 runs"):
        fitted(np.zeros((19, 1)), np.zeros(19))


def test_a_long_table_is_thinned_and_the_seed_decides_how() -> None:
    x = RNG(0).uniform(size=(90, 2))
    effort = Effort(points=40, iterations=20)
    first, again = fitted(x, x[:, 0], effort=effort), fitted(x, x[:, 0], effort=effort)
    assert len(first.points) == 40
    np.testing.assert_array_equal(first.points, again.points)


def test_log_inputs_act_as_ratios() -> None:
    x = np.exp(RNG(0).uniform(0, 7, (120, 1)))
    m = fit_mechanism(x, 10 + np.log(x[:, 0]), inputs(1, 0), binary=False, rng=RNG(0), effort=FULL)
    np.testing.assert_allclose(m.expected(np.array([[np.e], [np.e**5]])), [11, 15], atol=0.2)


@pytest.mark.parametrize(
    ("y", "expected"),
    [
        (RNG(0).normal(size=500), "identity"),
        (np.exp(RNG(0).normal(size=500)), "log"),
        (np.r_[0.0, np.expm1(np.abs(3 + RNG(0).normal(size=500)))], "log1p"),
        (np.ones(5), "identity"),
    ],
)
def test_the_transform_takes_the_skew_away(y: Floats, expected: str) -> None:
    assert best_transform(y) == expected


def test_the_gradient_is_the_gradient() -> None:
    points, targets = RNG(0).normal(size=(25, 3)), RNG(1).normal(size=25)
    posterior = _Posterior(points, targets)

    def value(theta: Floats) -> float:
        return posterior(theta)[0]

    def gradient(theta: Floats) -> Floats:
        return posterior(theta)[1]

    for seed in range(3):
        theta = RNG(seed).uniform(-1, 0.5, 6)
        assert check_grad(value, gradient, theta) < 1e-3
        kernel = Kernel(np.exp(theta[:3]), *np.exp(theta[3:]).tolist())
        covariance = kernel(points, points) + np.eye(25) * (kernel.noise**2 + JITTER)
        fit = 0.5 * targets @ np.linalg.solve(covariance, targets) + 0.5 * np.linalg.slogdet(covariance)[1]
        prior = np.log1p((kernel.relevance / RELEVANCE_SCALE) ** 2).sum()
        assert value(theta) == pytest.approx(fit + prior, rel=1e-12)
