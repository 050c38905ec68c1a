# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Package description for colcon (ament_python) and pip."""

from glob import glob
from pathlib import Path
import re

from setuptools import find_packages, setup

package_name = 'imu_allan'
here = Path(__file__).parent
# Pictures and links of the page lead into the repository, which a package page cannot show.
long_description = re.sub(
    r'!?\[([^\]]*)\]\((?!https?:)[^)]*\)', r'\1', (here / 'README.md').read_text('utf-8'))

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(include=['imu_allan', 'imu_allan.*']),
    package_data={'imu_allan': ['py.typed', '**/*.j2', '**/*.in']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
        (f'share/{package_name}/config', glob('config/*.*')),
        (f'share/{package_name}/launch', glob('launch/*.launch.py')),
    ],
    python_requires='>=3.10',
    install_requires=[
        'numpy>=1.26',
        'scipy>=1.11',
        'matplotlib>=3.6',
        'PyYAML>=6',
        'rich>=13',
        'rosbags>=0.10.9',
        'mcap>=1.1',
        'lz4>=4',
        'zstandard>=0.18',
        'isal>=1.6; platform_machine in "x86_64 AMD64 aarch64 arm64"',
        'typing_extensions>=4.0',
        'jinja2>=3.0',
    ],
    extras_require={
        'ros': [
            'ros-jazzy-rclpy[fastrtps]',
            'ros-jazzy-sensor-msgs',
            'ros-jazzy-diagnostic-msgs',
            'ros-jazzy-geometry-msgs',
            'ros-jazzy-std-msgs',
            'ros-jazzy-std-srvs',
            'ros-jazzy-rosgraph-msgs',
        ],
        'fleet': ['distributed'],
        'ardupilot': ['pymavlink>=2.4.40'],
        'test': [
            'pytest',
            'pytest-cov',
            'pytest-xdist>=3.7',
            'hypothesis',
            'allantools',
            'colcon-common-extensions',
            'opencv-python-headless',
            'pymavlink',
            'pyulog',
        ],
        'lint': [
            'ruff',
            'mypy',
            'types-PyYAML',
            'scipy-stubs',
            'ros-ament-flake8',
            'ros-ament-pep257',
            'flake8-builtins',
            'flake8-comprehensions',
            'flake8-docstrings',
            'flake8-import-order',
            'flake8-quotes',
        ],
        'docs': ['sphinx>=7', 'myst-parser>=3', 'furo', 'sphinx-mathjax-offline'],
    },
    zip_safe=True,
    author='The imu_allan authors',
    maintainer='The imu_allan authors',
    description='Allan deviation and noise coefficients of an IMU, live and from recordings',
    long_description=long_description,
    long_description_content_type='text/markdown',
    license='Apache-2.0',
    keywords=['Allan variance', 'IMU', 'gyroscope', 'accelerometer', 'noise', 'ROS 2'],
    # RELEASING.md: once the repository and the documentation have an address.
    project_urls={},
    classifiers=[
        'Development Status :: 4 - Beta',
        'Environment :: Console',
        'Intended Audience :: Developers',
        'Intended Audience :: Science/Research',
        'Operating System :: OS Independent',
        'Programming Language :: Python :: 3',
        'Programming Language :: Python :: 3.10',
        'Programming Language :: Python :: 3.11',
        'Programming Language :: Python :: 3.12',
        'Programming Language :: Python :: 3.13',
        'Programming Language :: Python :: 3.14',
        'Topic :: Scientific/Engineering',
        'Topic :: Scientific/Engineering :: Physics',
        'Typing :: Typed',
    ],
    entry_points={
        'console_scripts': [
            'imu_allan = imu_allan.__main__:main',
            'imu_allan_node = imu_allan.node.imu_allan_node:main',
            'imu_simulator = imu_allan.node.imu_simulator:main',
        ],
    },
)
