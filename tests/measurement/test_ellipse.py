"""Prediction ellipse and range: the probability they promise, and known shapes."""

import numpy as np
import pytest
from scipy import stats

from icmj.measurement.measures.prediction_ellipse import prediction_ellipse
from icmj.measurement.measures.prediction_range import prediction_range

COVARIANCE = np.array([[4.0, 1.5], [1.5, 1.0]])


def inside(ellipse, point):
    turn = np.array([[np.cos(ellipse.angle), np.sin(ellipse.angle)], [-np.sin(ellipse.angle), np.cos(ellipse.angle)]])
    return (((turn @ (point - ellipse.centre)) / ellipse.axes) ** 2).sum() <= 1


def test_a_further_point_lies_inside_with_the_probability_promised_however_few_there_are():
    rng, count = np.random.default_rng(3), 4000
    draws = rng.multivariate_normal([1, -2], COVARIANCE, (count, 9))
    hits = sum(inside(prediction_ellipse(points[:8]), points[8]) for points in draws)
    assert hits / count == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / count))
    values = draws[:, :, 0]
    half = np.array([prediction_range(v[:8]) for v in values]) / 2
    close = np.abs(values[:, 8] - values[:, :8].mean(axis=1)) <= half
    assert close.mean() == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / count))


def test_many_points_make_the_ellipse_of_chi_square():
    points = np.random.default_rng(4).multivariate_normal([1, -2], COVARIANCE, 200_000)
    found = prediction_ellipse(points)
    S = np.cov(points.T)
    assert found.area == pytest.approx(np.pi * stats.chi2.ppf(0.95, 2) * np.sqrt(np.linalg.det(S)), rel=5e-5)
    assert found.area == pytest.approx(np.pi * 5.991464547 * np.sqrt(np.linalg.det(COVARIANCE)), rel=0.01)
    assert np.degrees(found.angle) == pytest.approx(22.5, abs=0.5)  # tan 2α = 2·1.5/(4 − 1)
    assert prediction_range(points[:, 0]) == pytest.approx(2 * stats.norm.ppf(0.975) * 2, rel=0.01)


@pytest.mark.parametrize("turn", np.linspace(-1.5, 1.5, 7))
def test_it_turns_with_its_points(turn):
    cross = np.array([[3, 0], [-3, 0], [0, 1], [0, -1], [0, 0]], float)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    still, found = prediction_ellipse(cross), prediction_ellipse(cross @ rotation.T + [5, 6])
    assert found.angle == pytest.approx(turn)
    assert found.axes == pytest.approx(still.axes)
    assert still.axes[0] / still.axes[1] == pytest.approx(3)
    outline = found.outline()
    assert outline[0] == pytest.approx(outline[-1])
    closed = outline - found.centre
    area = abs((closed[:-1, 0] * closed[1:, 1] - closed[1:, 0] * closed[:-1, 1]).sum()) / 2
    assert area == pytest.approx(found.area, rel=1e-3)


def test_points_on_a_line_have_no_area():
    found = prediction_ellipse(np.column_stack([np.arange(10.0), 2 * np.arange(10.0)]))
    assert found.area == pytest.approx(0, abs=1e-6)
    assert found.angle == pytest.approx(np.arctan(2))
