# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Thresholds and priors chosen by judgment, which affect the results besides the data.

The prior of each shape is in `imu_allan.noise.posterior.shapes`, that of each trend of the mean in
`imu_allan.noise.trends.kinds`.
"""

import numpy as np

# -------------------------------------------------------------------------------- what is reported

OBSERVABLE = 0.5
"""Presence above which a term is reported: fewer than 1 in 100 clean records get a false one."""
REPORTED = 0.8
"""Probability above which quantization, a kind of noise, a filter or a trend of the mean is
reported. Quantization has a wider prior than other terms, so that N beside a weak one is right:
above 0.5, 1 in 50 clean records would get a false one."""
POSSIBLE = 0.25
"""Probability from which a longer record may show a term; used for the forecast only."""
CERTAIN_RAMP = 0.005
"""A ramp is reported when the probability of the opposite sign is below this value."""
UNEVEN = 11.0
"""A random walk is withdrawn when separate noise levels make the quarters likelier by this many
nats. Of 107 random walks of 1 to 3 hours, none exceeded 8.2."""
WIDEST = 3.0
"""Largest ratio of its interval ends with which the noise density is reported."""

# ------------------------------------------------------------------------------- goodness of a fit

DESCRIBED = 0.01
"""Chi-square probability above which residuals are attributed to chance. Below it, the misfitted
part of the spectrum counts less, and intervals widen."""
TOLERATED_MISFIT = 0.05
"""Tolerated relative misfit. A million samples reject 1 %, which is harmless; 5 % may matter."""
LEAST_DESCRIBED = 1 / 32
"""Least share of the noise below an edge: with less, what the model describes may not matter."""

# ----------------------------------------------------------------------------- model uncertainties

SHAPE_MEDIAN, SHAPE_SPREAD = 0.2, 1.0
"""Log-normal prior of the relative error of a filter's power, for each factor e that it
attenuates. A real filter is near a listed one, seldom equal to it; residuals show how near."""
LEAK_KNOWN = 2e-4
"""Uncertainty of the power in a stop band, relative to the pass band: notches are narrow."""

# -------------------------------------------------------------- priors that concern several shapes

COVERED = 6.0
"""Range of the log amplitude of a term that a record covers; it limits the uncertainty of noise
that quantization noise hides."""
EXPONENT_SPREAD = 0.35
"""Standard deviation about 1 of the exponent of slow noise in real sensors."""
EXPONENT_ODDS = 0.1
"""Prior odds of slow noise with another exponent against flicker."""
WITHOUT_FLICKER = 0.15
"""Prior factor of each slower noise without flicker: every sensor has some, and it shows first."""
UNSEEN_LEVEL = 0.2
"""Prior density of the log level of a half-octave above an edge."""
TOP, PER_HALF_OCTAVE = float(np.log(0.02)), -0.2
"""Log prior of an unexplained top of the spectrum, and its change per half-octave."""
STEADY_LEVEL = 0.9
"""Prior probability that the noise level is constant over a record."""
CHANGE_MEDIAN, CHANGE_SPREAD = 0.05, 0.8
"""Log-normal prior of the change otherwise; real accelerometers have 0.04 to 0.06."""
