# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""HTML pages from templates."""

from functools import cache
from importlib.resources import files
from typing import Any, TYPE_CHECKING

from imu_allan import wording
from imu_allan.errors import printable
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.sensor.units import engineering, MEAN_UNITS, typeset
from imu_allan.version import __version__

if TYPE_CHECKING:
    from jinja2 import Environment


def rendered(template: str, version: str = __version__, **context: Any) -> str:
    """Return the page rendered from a template; `version` is the one that the page names."""
    return _environment().get_template(template).render(
        mean_units=MEAN_UNITS, quantities=AXES, sensors=wording.SENSORS, terms=TERMS,
        version=version, **context)


def text_of(name: str) -> str:
    """Return the text of a template, style sheet or script."""
    return (files('imu_allan.writers') / 'templates' / f'{name}.j2').read_text(encoding='utf-8')


@cache
def _environment() -> 'Environment':
    """Return the templates; each is compiled when first used, a third of a page's time."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(loader=FunctionLoader(text_of), autoescape=True,
                              undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {
        'counted': wording.counted, 'datasheet': lambda unit: engineering(1, unit)[1],
        'duration': wording.duration, 'printable': printable, 'spoken': wording.spoken,
        'to': lambda value, form: '' if value is None else format(value, form), 'typeset': typeset}
    return environment
