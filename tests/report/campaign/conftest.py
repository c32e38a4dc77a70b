"""One measured campaign and its report for all tests of a worker."""

import pytest

from aqualog.campaign.bins import plan
from aqualog.report.campaign.findings import find
from aqualog.report.campaign.folder import write_report
from tests.report.campaign_case import load_case, make_case


@pytest.fixture(scope="session")
def case(tmp_path_factory):
    return load_case(make_case(tmp_path_factory.mktemp("case")))


@pytest.fixture(scope="session")
def findings(case):
    return find(case, plan(case, ()))


@pytest.fixture(scope="session")
def folder(case, findings, tmp_path_factory):
    out = tmp_path_factory.mktemp("report") / "out"
    write_report(case, findings, out)
    return out
