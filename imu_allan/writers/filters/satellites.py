# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Integrated navigation with satellites: biases as first-order Gauss-Markov processes."""

from math import pi, sqrt

from imu_allan.sensor.units import STANDARD_GRAVITY
from imu_allan.writers.filters.chosen_numbers import N, Numbers, SIGMA, TIME
from imu_allan.writers.filters.layout import (
    heading,
    indented,
    joined,
    Pair,
    pairs,
    real,
    times,
    triples,
)

_DEGREE = pi / 180              # rad
_ARW = _DEGREE / 60             # rad/s/sqrt(Hz) in 1 deg/sqrt(h)
_VRW = 1 / 60                   # m/s^2/sqrt(Hz) in 1 m/s/sqrt(h)
_DEG_PER_HOUR = _DEGREE / 3600    # rad/s in 1 deg/h
_MILLIGAL = 1e-5                # m/s^2
_UG = STANDARD_GRAVITY * 1e-6   # m/s^2

_Rows = tuple[tuple[Pair, str, float, str], ...]
_GINS: _Rows = ((('gyro', N), 'arw', _ARW, 'deg/sqrt(h)'),
                (('accel', N), 'vrw', _VRW, 'm/s/sqrt(h)'),
                (('gyro', SIGMA), 'gbstd', _DEG_PER_HOUR, 'deg/h'),
                (('accel', SIGMA), 'abstd', _MILLIGAL, 'mGal'))
_NAVEGO: _Rows = ((('gyro', N), 'arw', _ARW, 'deg/sqrt(h)'),
                  (('accel', N), 'vrw', _VRW, 'm/s/sqrt(h)'),
                  (('gyro', SIGMA), 'gb_dyn', _DEGREE / sqrt(2), 'deg/s'),
                  (('accel', SIGMA), 'ab_dyn', STANDARD_GRAVITY * 1e-3 / sqrt(2), 'mg'),
                  (('gyro', TIME), 'gb_corr', 1.0, 's'), (('accel', TIME), 'ab_corr', 1.0, 's'))
_PSINS: _Rows = ((('gyro', N), 'web', _ARW, 'deg/sqrt(h)'),
                 (('accel', N), 'wdb', _UG, 'ug/sqrt(Hz)'),
                 (('gyro', SIGMA), 'sqrtR0G', _DEG_PER_HOUR, 'deg/h'),
                 (('gyro', TIME), 'TauG', 1.0, 's'), (('accel', SIGMA), 'sqrtR0A', _UG, 'ug'),
                 (('accel', TIME), 'TauA', 1.0, 's'))


def kf_gins(numbers: Numbers) -> str:
    """
    KF-GINS' ``imunoise``: deg/sqrt(h), m/s/sqrt(h), deg/h, mGal and hours, for each axis.

    ``loadConfig`` (kf_gins.cpp) converts them so (arw by pi/180/60, gbstd by pi/180/3600, abstd by
    1e-5, corrtime by 3600). ``GIEngine::GIEngine`` (gi_engine.cpp) drives biases and scale factors
    by ``2 sigma^2/Tc``, and ``GIEngine::insPropagation`` lets them decay by ``-1/Tc``. Where the
    file has no ``initbgstd`` and ``initbastd``, the filter begins with gbstd and abstd.
    """
    lines = [*heading(numbers), '# gsstd and asstd, the scale factors, are not seen at rest: '
             'leave them. corrtime is theirs, too.',
             '# Without initbgstd and initbastd the filter begins with gbstd and abstd, but a '
             'bias is off by more at the', '# start: set them to what it is off by then.',
             'imunoise:']
    body: list[str] = []
    for pair, name, unit, text in _GINS:
        body += triples(numbers, {pair: name}, times(1 / unit), '', {pair: text})
    lines += indented(body + _correlation_time(numbers), 2)
    return joined(lines)


def ob_gins(numbers: Numbers) -> str:
    """
    OB_GINS' ``imumodel``: the same units as KF-GINS, one value for a sensor.

    ob_gins.cc converts them so; the preintegration uses ``phi = 1 - dt/Tc`` and ``2 sigma^2/Tc``.
    """
    lines = [*heading(numbers), 'imumodel:']
    body: list[str] = []
    for pair, name, unit, text in _GINS:
        body += pairs(numbers, {pair: name}, times(1 / unit), '', {pair: text})
    lines += indented(body + _correlation_time(numbers), 2)
    return joined(lines)


def _correlation_time(numbers: Numbers) -> list[str]:
    found = numbers.worst('gyro', TIME) or numbers.worst('accel', TIME)
    if found is None:
        return ['', '# corrtime: this result has no value for it']
    return ['', '# Tc [h], the same for both sensors',
            f'corrtime: {real(found[1].value / 3600)}']


def navego(numbers: Numbers) -> str:
    """
    Write NaveGo's IMU profile, in the units of ``imu_si_errors.m``.

    That function makes of ``gb_dyn`` the driving density ``gb_dyn/sqrt(gb_corr)``, which is
    ``sigma sqrt(2/Tc)`` of the process: gb_dyn is sqrt(2) sigma. F_update.m lets the bias decay by
    ``-1/gb_corr``, and kf_prediction.m adds the squared densities times dt. ``allan_imu.m`` writes
    rad/s and m/s^2 under the same names, which are not to be given to imu_si_errors. That reads
    ``arrw`` and ``vrrw``, too, walks beside the process, of which the tuned numbers have none.
    """
    lines = [*heading(numbers, '%'),
             '% For imu_si_errors(imu, dt): deg/sqrt(h), m/s/sqrt(h), deg/s, mg, s. gb_dyn and '
             'ab_dyn are sqrt(2) sigma,', '% because imu_si_errors divides them by the root of '
             'the correlation time. (allan_imu gives rad/s and m/s^2', '% under these names: do '
             'not mix the two.) gb_sta (deg/s) and ab_sta (mg), the biases at the start,',
             '% are not seen in one recording: set them yourself.']
    for pair, name, unit, text in _NAVEGO:
        scaling = 'sqrt(2)' if name.endswith('dyn') else ''
        lines += triples(numbers, {pair: name}, times(1 / unit), scaling,
                         {pair: text}, 'imu.{name} = [{value}];', '%')
    lines += ['', '% walks beside the process: the drift is in gb_dyn and ab_dyn',
              'imu.arrw = [0.0, 0.0, 0.0];', 'imu.vrrw = [0.0, 0.0, 0.0];']
    return joined(lines)


def psins(numbers: Numbers) -> str:
    """
    Arguments of PSINS' ``imuerrset``: deg/sqrt(h), ug/sqrt(Hz), deg/h, ug and s.

    imuerrset.m drives the bias by ``sqrtR0G sqrt(2/TauG)``: sqrtR0G is sigma. Of the filters in
    kfinit.m only ``kfinit186`` has these densities in its ``Qt``; the others hold the biases for
    constants. The time by which a bias decays is ``ins.tauG`` (etm.m), which insinit.m leaves
    infinite. The constant biases eb and db are those
    from one start to the next, which no recording at rest shows. The filters begin with them
    (``Pxk = diag([davp0; imuerr.eb; imuerr.db])^2``) and never learn a bias that is certain to be
    zero: no value is written, so that none is taken unseen.
    """
    lines = [*heading(numbers, '%'),
             "% x, y, z are the axes of the recording. PSINS' own are right, front, up: where the "
             'data is turned to', '% them, turn these columns with it.',
             '% eb (deg/h) and db (ug) are what the biases are off by at the start; the filters '
             'begin with them.',
             '% They are not seen in one recording and have no value here: set both before this '
             'runs, not to 0.']
    for pair, name, unit, text in _PSINS:
        lines += triples(numbers, {pair: name}, times(1 / unit), '',
                         {pair: text}, "{name} = [{value}]';", '%')
    lines += ['', 'imuerr = imuerrset(eb, db, web, wdb, sqrtR0G, TauG, sqrtR0A, TauA);',
              '% The biases decay by the times in ins, not in imuerr. After ins = insinit(...):',
              '%     ins.tauG = imuerr.taug;  ins.tauA = imuerr.taua;',
              '% Of the filters of kfinit only psinstypedef(186) takes the drift (imuerr.sqg, '
              'imuerr.sqa); the others hold the', '% biases for constants and are sure of them '
              'too soon: what is expected above is not of those.']
    return joined(lines)
