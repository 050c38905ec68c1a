# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Processor time of decoding an Imu nested in another message, over that of a bare one.

The nested one stands in what a VectorNav driver publishes: header, Imu, MagneticField and a raw
string, 573 bytes instead of 324. Both are decoded from memory, 2048 messages at a time as they
come out of a chunk; passes alternate and medians are printed.

    python bench/bench_messages.py [--messages 100000] [--repeats 15]
"""

import argparse
import time
from typing import Any

from imu_allan.cdr import MessageBatch
from imu_allan.recordings.messages.imus_in import imu_messages
import numpy as np
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

KIND = 'my_driver/msg/Vectornav'
TEXT = ('std_msgs/Header header\nsensor_msgs/Imu imu\nsensor_msgs/MagneticField mag\n'
        'string raw\n')
AT_A_TIME = 2048


def serialized(store: Any) -> dict[str, bytes]:
    """Return one message of each type, as rosbags writes it."""
    types = store.types
    header = types['std_msgs/msg/Header'](
        types['builtin_interfaces/msg/Time'](1_700_000_000, 123), 'imu_link')
    zeros = np.zeros(9)
    vector = types['geometry_msgs/msg/Vector3'](1.0, 2.0, 3.0)
    imu = types['sensor_msgs/msg/Imu'](
        header, types['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0), zeros, vector, zeros,
        vector, zeros)
    nested = types[KIND](
        header, imu, types['sensor_msgs/msg/MagneticField'](header, vector, zeros), 'VNYMR' * 20)
    return {kind: bytes(store.serialize_cdr(message, kind))
            for kind, message in (('sensor_msgs/msg/Imu', imu), (KIND, nested))}


def main() -> None:
    """Print the times and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--messages', type=int, default=100_000)
    parser.add_argument('--repeats', type=int, default=15)
    options = parser.parse_args()
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(TEXT, KIND))
    stamps = np.arange(AT_A_TIME, dtype=np.int64)
    work = []
    for kind, message in serialized(store).items():
        definition, _ = store.generate_msgdef(kind, ros_version=2)
        batches = [MessageBatch(np.tile(np.frombuffer(message, np.uint8), (AT_A_TIME, 1)), stamps)
                   for _ in range(max(options.messages // AT_A_TIME, 1))]
        work.append((imu_messages(kind, definition).decoder(), batches))
    times = np.empty((options.repeats, 2))
    for repeat in range(options.repeats):
        for column, (decode, batches) in enumerate(work):
            start = time.process_time()
            for batch in batches:
                decode([batch], print)
            times[repeat, column] = time.process_time() - start
    each = np.median(times, axis=0) / (len(work[0][1]) * AT_A_TIME) * 1e6
    print(f'bare {each[0]:.3f} us   nested {each[1]:.3f} us   '
          f'ratio {np.median(times[:, 1] / times[:, 0]):.2f}')


if __name__ == '__main__':
    main()
