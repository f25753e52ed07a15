"""A cluster that has no workers is waited for, and not for ever."""

from __future__ import annotations

import threading

import pytest

from armload.errors import ClusterError
from armload.lab.engine import Engine

distributed = pytest.importorskip("distributed")


@pytest.fixture
def cluster():
    with distributed.LocalCluster(n_workers=0, processes=False, dashboard_address="127.0.0.1:0") as made:
        yield made


def double(x):
    return 2 * x


def test_a_cluster_that_gets_no_worker_is_given_up_with_what_to_do(cluster):
    with (
        distributed.Client(cluster) as client,
        pytest.raises(ClusterError, match=r"no worker for 0\.01 minutes: start one"),
    ):
        list(Engine(1, client, patience=0.6).each(double, lambda: [1, 2]))


def test_a_worker_that_comes_late_does_all_tasks(cluster):
    with distributed.Client(cluster) as client:
        late = threading.Timer(0.5, cluster.scale, [1])
        late.start()
        found = list(Engine(1, client, patience=120.0).each(double, lambda: range(5)))
        late.join()
    assert sorted(found) == [(k, 2 * k) for k in range(5)]
