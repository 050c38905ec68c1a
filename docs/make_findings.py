# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Write docs/findings.md from the table of words.

    .venv/bin/python docs/make_findings.py
"""

from pathlib import Path

from imu_allan.writers.words import explained, WORDS

HEAD = """\
# Findings

Made from `imu_allan/writers/words.py` by `docs/make_findings.py`.
`imu_allan explain CODE` prints one of them.

A result lists what was found as `warnings`, those to act upon first:

```json
{"code": "band_limited", "severity": "know", "axes": ["gyro_x", "gyro_y"],
 "values": {"window_s": [0.0148, 0.0152]}, "message": "..."}
```

`severity` is `act` where the numbers are not what you want until you do something,
and `know` where they are.
`values` are figures in SI units.
Of several axes, a value that differs is a list with one number for each axis.
Scripts may rely on `code`, `severity`, `axes` and `values`.
`message` is made from them, and nothing reads it.
"""


def page() -> str:
    """Return the text of the page."""
    parts = [HEAD]
    for code in WORDS:
        title, *lines = explained(code)
        parts += [f'## {code}', '', f'**{title.partition(": ")[2]}**', '',
                  *(f'- {line}' for line in lines), '']
    return '\n'.join(parts)


if __name__ == '__main__':
    Path(__file__).with_name('findings.md').write_text(page())
