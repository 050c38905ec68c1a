# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Write docs/findings.md from the table of words.

    .venv/bin/python docs/make_findings.py
"""

from collections.abc import Iterator
from pathlib import Path

from imu_allan.finding import CODES
from imu_allan.finding_messages import values_of
from imu_allan.finding_texts import WORDS, Words

HEAD = """\
# Findings

What findings mean, how they are detected, and what to do. `imu_allan explain CODE` prints one of
them.

A result lists them as `warnings`:

```json
{"code": "band_limited", "severity": "know", "axes": ["gyro_x", "gyro_y"],
 "values": {"window_s": [0.0148, 0.0152]}, "message": "..."}
```

`severity` is `act` if you should do something before using the numbers, otherwise `know`.
Scripts may rely on all fields but `message`. `values` are in SI units, as a list if axes differ.
Those marked "?" may be absent. The suffix of a name is its unit, otherwise the value `unit` has
it. `recording` names one of several; `more` counts what is left out.

Italics say how a finding is detected. *Do* is for a recording, *live* for a running node if that
differs.
"""


def page() -> str:
    """Return the text of the page: severe findings first, in the order in which they are shown."""
    parts = [HEAD]
    for severity, title in (('act', 'To act upon'), ('know', 'Good to know')):
        parts += [f'## {title}', '']
        for code, words in WORDS.items():
            if CODES[code].severity == severity:
                parts += [f'### {code}', '', ' '.join(sentences(code, words)), '']
    return '\n'.join(parts)


def sentences(code: str, words: Words) -> Iterator[str]:
    """Yield what a finding means, how it is found, and the advice that is the same for all."""
    if words.title != code.replace('_', ' '):
        yield f'**{words.title}.**'
    yield words.means
    yield f'*{words.found.removesuffix(".")}*.'
    do, live = str(words.general or words.do), words.live or ''
    if do:
        yield f'*Do:* {do}.'
    if live:
        same = bool(do) and live.startswith(do)
        yield f'*Live:* {"the same" + live[len(do):] if same else live}.'
    if values := values_of(code):
        yield ', '.join(f'`{value}`' for value in values)


if __name__ == '__main__':
    Path(__file__).with_name('findings.md').write_text(page())
