# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""How near each tool comes to the truth of simulated sensors."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
import tempfile
from typing import Any

from adapters import adapter
import numpy as np
from recorded import AXES, B, Estimate, K, N, Q, R, Recorded, RefusedError
from simulated import bound, Case, CASES, record, truth

_ALPHA = 0.05


def interval_score(estimate: Estimate, true: float) -> float:
    """Return width plus 40 times the miss of a 95 % interval, over the truth."""
    assert estimate.low is not None
    assert estimate.high is not None
    miss = max(estimate.low - true, true - estimate.high, 0.0)
    return (estimate.high - estimate.low + 2 / _ALPHA * miss) / true


def asked(tool: str, recording: Recorded) -> tuple[Any, str | None]:
    """Return what a tool answers, or None and why it refuses."""
    try:
        return adapter(tool).answer(recording), None
    except RefusedError as refusal:
        return None, str(refusal)


def scores(case: Case, answers: Sequence[Any]) -> dict[str, dict[str, float]]:
    """Return the scores of one tool in one case; every axis of every record counts."""
    best = bound(case)
    found: dict[str, dict[str, float]] = {}
    axes = len(answers) * len(AXES)
    for key in (N, B, K, Q, R):
        errors, scored, covered = [], [], []
        reported = 0
        for answer in answers:
            for axis in AXES:
                estimate = (answer or {}).get(axis, {}).get(key, Estimate(None))
                true = truth(case, axis).get(key)
                reported += estimate.value is not None
                if true is None:
                    continue
                if estimate.value is not None:
                    errors.append(estimate.value / true - 1)
                if estimate.low is not None:
                    scored.append(interval_score(estimate, true))
                    covered.append(estimate.low <= true <= estimate.high)
        if key not in case.terms:
            found[key] = {'false': reported / axes}
            continue
        found[key] = {'reported': reported / axes}
        if errors:
            rmse = float(np.sqrt(np.mean(np.square(errors))))
            found[key] |= {'rmse': rmse, 'over_bound': rmse / best[key]}
        if scored:
            found[key] |= {'coverage': float(np.mean(covered)), 'score': float(np.mean(scored))}
    return found


def run(cases: Sequence[str], tools: Sequence[str], records: int) -> dict[str, Any]:
    """Draw the records, ask every tool, and score."""
    found: dict[str, Any] = {}
    for key in cases:
        answers, refusals = defaultdict(list), defaultdict(list)
        for number in range(records):
            with tempfile.TemporaryDirectory() as folder:
                recording = record(key, number, Path(folder))
                for tool in tools:
                    answer, refusal = asked(tool, recording)
                    answers[tool].append(answer)
                    if refusal:
                        refusals[tool].append(refusal)
        found[key] = {
            'title': CASES[key].title, 'records': records, 'bound': bound(CASES[key]),
            'tools': {tool: {'coefficients': scores(CASES[key], answers[tool]),
                             'refused': len(refusals[tool]) / records,
                             'reason': refusals[tool][0] if refusals[tool] else None}
                      for tool in tools}}
        print(f'{key}: done', flush=True)
    return found
