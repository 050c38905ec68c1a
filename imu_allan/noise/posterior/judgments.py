# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the numbers of a user depend on beside the data, each judgment with its effect.

The prior of a shape stands beside its power (`imu_allan.noise.posterior.shapes`), that of a trend
of the mean beside its columns (`imu_allan.noise.posterior.trends`).
"""

import numpy as np

# -------------------------------------------------------------------------------- what is reported

OBSERVABLE = 0.5
"""Presence from which a term is reported: below 1 in 100 clean records has a false one."""
REPORTED = 0.8
"""The same of what kind of noise it is, of a filter, and of what moves the mean."""
POSSIBLE = 0.25
"""The same from which a longer record may show a term: it decides on the forecast alone."""
CERTAIN_RAMP = 0.005
"""Probability that a ramp has the other sign, below which it is reported."""
UNEVEN = 11.0
"""Nats by which quarters have to be likelier with a noise each than with one to take back a random
walk. Of 107 walks in 1 to 3 hours none had more than 8.2."""
WIDEST = 3.0
"""Ratio of the ends of its interval up to which the noise density is reported."""
LEAST_KNOWN = 16.0
"""Information about white noise below a filter's corner, four standard errors, with which there is
such a filter: with less it is a step of the spectrum."""

# -------------------------------------------------------------------- whether a model describes it

DESCRIBED = 0.01
"""Chi-square probability of the residuals above which they are chance; below, the record is worth
less where it is missed, and intervals are wider."""
TOLERATED_MISFIT = 0.05
"""A million samples reject a misfit of 1 %, which no user cares about; at 5 % some do."""
LEAST_DESCRIBED = 1 / 64
"""Edge in cycles per sample below which the larger part of the noise is not described."""

# ----------------------------------------------------------------------- how well models are known

NAMED, UNNAMED = 0.01, 0.2
"""Share of what it takes to which a filter is known, with a name and without one."""
LEAK_KNOWN = 2e-4
"""Share of the pass band to which power in a stop band is known: notches are narrow."""

# -------------------------------------------------------------------------- priors of no one shape

EXPONENT_SPREAD = 0.35
"""Standard deviation of the exponent of slow noise about 1 in real sensors."""
EXPONENT_ODDS = 0.1
"""Of slow noise with another exponent, against flicker."""
WITHOUT_FLICKER = 0.3
"""Of each slower noise where no flicker shows: every sensor has some, and it shows first."""
UNSEEN_LEVEL = 0.2
"""Density of the logarithm of the level of a half-octave that no model explains."""
TOP, PER_HALF_OCTAVE = float(np.log(0.02)), -0.2
"""Logarithm of the prior of a top that no filter explains, and its change per half-octave."""
STEADY_LEVEL = 0.9
"""Probability that the level of the noise stays the same from part to part of a record."""
CHANGE_MEDIAN, CHANGE_SPREAD = 0.05, 0.8
"""Of its change where it does not, log-normal: real accelerometers have .04 to .06."""
