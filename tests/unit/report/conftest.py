"""Pages to look at and the fits that they show."""

from __future__ import annotations

import pytest

from sample_reports import arm_report, bench_report


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "browser: opens a page in headless Chromium")


@pytest.fixture(scope="session")
def arm():
    return arm_report()


@pytest.fixture(scope="session")
def bench():
    return bench_report()


@pytest.fixture(scope="session")
def arm_content(arm):
    return arm.content


@pytest.fixture(scope="session")
def bench_content(bench):
    return bench.content


@pytest.fixture(scope="session")
def large():
    return arm_report(n_conf=12, n_validation=12)
