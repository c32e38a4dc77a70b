import pytest

from aqualog.core.intervals import student_quantile


def test_quantiles_of_student():
    for dof, quantile in ((1, 12.7062), (2, 4.3027), (5, 2.5706), (11, 2.2010), (100, 1.9840)):
        assert student_quantile(0.975, dof) == pytest.approx(quantile, rel=1e-4)
