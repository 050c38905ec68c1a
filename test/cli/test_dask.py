# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A Dask cluster that works on recordings, and addresses where there is none."""

import socket

from imu_allan.cli import dask_cluster
import pytest

distributed = pytest.importorskip('distributed')


@pytest.mark.slow
def test_a_dask_cluster_gives_the_same_results(recording, analyzed):
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1,
                                  dashboard_address=None) as cluster:
        assert analyzed(recording) == analyzed(recording, '--dask', cluster.scheduler_address)


def test_a_dask_address_where_nobody_answers_or_somebody_is_silent_is_one_line(
        recording, monkeypatch, fails_with):
    monkeypatch.setattr(dask_cluster, 'ANSWER_S', 0.5)
    with socket.create_server(('127.0.0.1', 0)) as silent:
        for address, reason in ((f'tcp://127.0.0.1:{silent.getsockname()[1]}', 'TimeoutError'),
                                ('not an address', '<words>')):
            fails_with(f'--dask {address}: no scheduler answers ({reason}); start one with: dask '
                       'scheduler', 'analyze', recording, '--dask', address)
