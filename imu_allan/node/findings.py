# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Findings in the words of a running node: what one can do now, not with which option later."""

from imu_allan.result import Remark

_REMEDIES = {
    'rate_changed': 'a change that lasts begins a new run by itself',
    'several_frames': 'a change that lasts begins a new run by itself; give every IMU a topic of '
                      'its own',
    'several_publishers': 'give every IMU a topic of its own',
    'noise_level_changed': 'call ~/reset to characterize the present level alone',
    'many_missing': 'ask for a deeper queue or for reliable delivery with qos_overrides',
    'mostly_motion': 'let the IMU rest, or set motion to keep',
    'bias_step': 'call ~/reset to characterize what lies behind it alone',
    'stood_still': 'look at the sensor and its driver, then call ~/reset',
    'saturated': 'then call ~/reset',
    'deadband': 'then call ~/reset',
    'unit_g': 'set accel_unit to g to say so, to m/s^2 to take the numbers as they are',
}


def live_text(remark: Remark) -> str:
    """Return the message with advice for a running node instead of that for a recording."""
    clauses = [clause for clause in remark.message.split('; ') if ' --' not in clause]
    text = '; '.join(clauses) or remark.message.partition(' --')[0]
    # One driver that changes its frame_id looks the same.
    text = text.replace('several publishers on one topic', 'more than one frame_id on the topic')
    remedy = _REMEDIES.get(remark.code)
    if remedy is None:
        return text
    # What a recording should have had comes after a colon.
    if remark.code in ('many_missing', 'mostly_motion'):
        text = text.partition(': record ')[0]
    return f'{text}; {remedy}'
