# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
#
# The node and the command on ROS 2 Jazzy, as a user without rights:
#   docker build -t imu_allan .
#   docker run --rm --net=host -v "$PWD:/data" --user "$(id -u):$(id -g)" imu_allan \
#     imu_allan_node --ros-args -p output_dir:=/data -r imu/data_raw:=/my_imu/data_raw
#   docker run --rm -v "$PWD:/data" --user "$(id -u):$(id -g)" imu_allan imu_allan analyze imu_at_rest
FROM ros:jazzy-ros-base

SHELL ["/bin/bash", "-o", "pipefail", "-c"]
WORKDIR /workspace
COPY . src/imu_allan
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3-pip \
    && rosdep update --rosdistro jazzy \
    && rosdep install --from-paths src --ignore-src --rosdistro jazzy -y \
        --dependency-types build --dependency-types exec \
    && pip install --no-cache-dir --break-system-packages rosbags mcap lz4 zstandard isal \
    && source /opt/ros/jazzy/setup.bash \
    && colcon build --merge-install --packages-select imu_allan \
    && rm -rf build log src /var/lib/apt/lists/*

RUN printf '%s\n' '#!/bin/bash' 'set -e' 'source /workspace/install/setup.bash' \
        'export PATH="/workspace/install/lib/imu_allan:$PATH"' 'exec "$@"' \
        > /usr/local/bin/with_workspace \
    && chmod +x /usr/local/bin/with_workspace \
    && useradd --create-home --uid 10001 imu \
    && install -d -o imu -g imu /data
USER imu
WORKDIR /data
# The state of a run outlives the container. Through /dev/shm nothing comes from a driver of another
# user, or outside of the container.
ENV ROS_HOME=/data/.ros MPLCONFIGDIR=/tmp/matplotlib FASTDDS_BUILTIN_TRANSPORTS=UDPv4
ENTRYPOINT ["with_workspace"]
CMD ["imu_allan_node", "--ros-args", "-p", "output_dir:=/data"]
